# Everything a fresh machine needs: `make render` makes a picture, `make test` runs every check.

VENV := .venv
BIN := $(VENV)/bin

.DEFAULT_GOAL := help
.PHONY: help setup render gallery validate bench docs test lint format clean distclean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "make %-10s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: ## create .venv with everything in it, and install LLVM 17 or newer where none is (PYTHON=... picks the Python)
	@bash scripts/setup.sh

render: setup ## render scenes/classic.toml to out/classic.png and out/classic.exr
	@mkdir -p out
	@$(BIN)/tracer render scenes/classic.toml -o out/classic.png -o out/classic.exr

gallery: setup ## render every scene of scenes/ into docs/gallery; what did not change is not rendered again
	@$(BIN)/python -m scripts.gallery

validate: setup ## compare with Mitsuba ray by ray: the full report, its summary in reports/, the headline numbers in README.md
	@$(BIN)/tracer validate --full --summary reports/crossvalidation.md --headline README.md

bench: setup ## measure speed and memory next to Mitsuba and POV-Ray, everything: reports/benchmark/index.html and its summary
	@$(BIN)/tracer bench --full --summary reports/benchmark.md

docs: setup ## build the documentation site into build/docs; open build/docs/index.html
	@$(BIN)/python -m sphinx -q -W -n --keep-going -d build/doctrees docs build/docs

test: lint ## run the linters, the type checker and all tests, quick and slow
	$(BIN)/python -m pytest -m "" --numprocesses auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder

lint: setup ## run the linters and the type checker
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: setup ## lay out the code and sort the imports
	$(BIN)/ruff check --fix --select I .
	$(BIN)/ruff format .

clean: ## remove pictures, caches and builds
	rm -rf out build dist .mypy_cache .pytest_cache .ruff_cache
	find tracer reference tests scripts docs assets -type d -name __pycache__ -prune -exec rm -rf {} + 2>/dev/null || true

distclean: clean ## remove the virtual environment too
	rm -rf $(VENV)
