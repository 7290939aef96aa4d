"""Imports go one way: the walls of the house, read from the syntax tree of every module.

Imports inside functions count as well; only those for the type checker (`if TYPE_CHECKING:`) do not.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

LAYERS: tuple[frozenset[str], ...] = (
    frozenset({"errors", "records"}),
    frozenset({"color", "material", "lights", "camera", "shapes", "textures"}),
    frozenset({"scene"}),
    frozenset({"device_scene"}),
    frozenset({"whitted"}),
    frozenset({"render", "queries", "chains"}),
    frozenset({"viewer"}),
    frozenset({"cli"}),
)
"""Rooms of `tracer` from the ground up; a room reaches its own layer and lower ones, also through helpers."""

COMPARING = {"tracer.cli.validate", "tracer.cli.export", "tracer.cli.bench", "tracer.viewer.comparison"}
"""The only modules of `tracer` that see `mitsuba` and `reference`, and that inside functions alone."""

INDEPENDENT = {
    "reference.plain",
    "reference.plain_layers",
    "reference.plain_files",
    "reference.plain_gltf",
    "reference.plain_polygons",
}
"""The model written a second time: it shares no code with `tracer`."""


@dataclass(frozen=True)
class Import:
    """One import statement's target, such as `tracer.scene.files`, and where it stands."""

    target: str
    line: int
    inside_function: bool


def read_modules(root: Path) -> dict[str, list[Import]]:
    """The imports of every module below `root/tracer` and `root/reference`, by the module's dotted name."""
    files = [file for package in ("tracer", "reference") for file in sorted((root / package).rglob("*.py"))]
    names = {
        file: ".".join(file.relative_to(root).with_suffix("").parts).removesuffix(".__init__")
        for file in files
    }
    known = set(names.values())
    return {
        name: list(imports_of(ast.parse(file.read_text(encoding="utf-8")), package_of(file, name), known))
        for file, name in names.items()
    }


def package_of(file: Path, name: str) -> str:
    """The package that a relative import in this file starts from."""
    return name if file.name == "__init__.py" else name.rpartition(".")[0]


def imports_of(
    node: ast.AST, package: str, known: set[str], inside_function: bool = False
) -> Iterator[Import]:
    """All imports below a node, those of type-checking blocks left out."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and ast.unparse(child.test).endswith("TYPE_CHECKING"):
            continue
        if isinstance(child, ast.Import):
            yield from (Import(alias.name, child.lineno, inside_function) for alias in child.names)
        elif isinstance(child, ast.ImportFrom):
            ancestors = package.split(".")[: len(package.split(".")) - child.level + 1] if child.level else []
            base = ".".join([*ancestors, *([child.module] if child.module else [])])
            for alias in child.names:
                submodule = f"{base}.{alias.name}"
                yield Import(submodule if submodule in known else base, child.lineno, inside_function)
        else:
            in_function = inside_function or isinstance(
                child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)
            )
            yield from imports_of(child, package, known, in_function)


def room(module: str) -> str:
    """`tracer.scene.files` is in the room `tracer.scene`; the package itself is a room of its own."""
    return ".".join(module.split(".")[:2])


def rooms_of(modules: dict[str, list[Import]]) -> dict[str, set[str]]:
    """Which rooms a room imports from, within `tracer` and `reference`."""
    graph: dict[str, set[str]] = {}
    for module, imports in modules.items():
        targets = {room(entry.target) for entry in imports if is_ours(entry.target)}
        graph.setdefault(room(module), set()).update(targets - {room(module)})
    return graph


def is_ours(target: str) -> bool:
    return target.split(".")[0] in ("tracer", "reference")


def path_to(graph: dict[str, set[str]], start: str, goals: set[str]) -> list[str] | None:
    """A shortest chain of imports from a room to one of the goals."""
    chains, seen = [[start]], {start}
    for chain in chains:
        for following in sorted(graph.get(chain[-1], ())):
            if following in goals:
                return [*chain, following]
            if following not in seen:
                seen.add(following)
                chains.append([*chain, following])
    return None


MODULES = read_modules(ROOT)


def test_rooms_do_not_import_in_circles() -> None:
    try:
        TopologicalSorter(rooms_of(MODULES)).prepare()
    except CycleError as error:
        pytest.fail("imports in a circle: " + " <- ".join(error.args[1]))


@pytest.mark.parametrize("layer", range(len(LAYERS) - 1))
def test_a_layer_reaches_no_higher_one(layer: int) -> None:
    graph = rooms_of(MODULES)
    higher = {f"tracer.{name}" for names in LAYERS[layer + 1 :] for name in names}
    chains = [path_to(graph, f"tracer.{name}", higher) for name in sorted(LAYERS[layer])]
    assert not [" -> ".join(chain) for chain in chains if chain]


def test_tracer_sees_mitsuba_and_reference_only_where_it_compares() -> None:
    offences = [
        f"{module}, line {entry.line}: {entry.target}"
        for module, imports in MODULES.items()
        for entry in imports
        if module.split(".")[0] == "tracer" and entry.target.split(".")[0] in ("mitsuba", "reference")
        if module not in COMPARING or not entry.inside_function
    ]
    assert not offences


@pytest.mark.parametrize("module", sorted(INDEPENDENT))
def test_the_plain_model_shares_nothing_with_tracer(module: str) -> None:
    graph = rooms_of(MODULES)
    assert module in graph, "the second implementation is gone"
    others = {name for name in graph if name.split(".")[0] == "tracer"}
    assert path_to(graph, module, others) is None
    assert path_to(graph, "reference", others) is None, "reference/__init__.py runs first"


def test_the_walk_sees_every_form_of_import(tmp_path: Path) -> None:
    (tmp_path / "tracer" / "scene").mkdir(parents=True)
    (tmp_path / "tracer" / "scene" / "__init__.py").write_text("from ..errors import TracerError\n")
    (tmp_path / "tracer" / "errors.py").write_text(
        "import tracer.scene.files as f\n"
        "from typing import TYPE_CHECKING\n"
        "if TYPE_CHECKING:\n    from tracer.cli import main\n"
        "try:\n    from tracer import scene\nexcept ImportError:\n    pass\n"
        "class A:\n    def b(self):\n        import mitsuba\n"
    )
    modules = read_modules(tmp_path)
    assert modules["tracer.scene"] == [Import("tracer.errors", 1, False)]
    assert modules["tracer.errors"][0] == Import("tracer.scene.files", 1, False)
    assert Import("tracer.scene", 6, False) in modules["tracer.errors"]
    assert Import("mitsuba", 11, True) in modules["tracer.errors"]
    assert not any(entry.target == "tracer.cli" for entry in modules["tracer.errors"])
    with pytest.raises(CycleError):
        TopologicalSorter(rooms_of(modules)).prepare()
    assert path_to(rooms_of(modules), "tracer.errors", {"tracer.scene"}) == ["tracer.errors", "tracer.scene"]
