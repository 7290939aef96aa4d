"""The prose says what is there: links, names, paths, the README's example and every command line."""

from __future__ import annotations

import importlib
import inspect
import re
import shlex
from functools import cache
from pathlib import Path
from typing import Any

import click
import pytest

from tracer.assets import builtin_scenes
from tracer.cli.app import cli
from tracer.scene import load

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("assets/*.md")])

FENCE = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
INDENTED = re.compile(r"^ {4,}.*$", re.MULTILINE)
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
INLINE_CODE = re.compile(r"`([^`\n]+)`")
PATH = re.compile(r"(?:tracer|reference|tests|scripts|docs)/[\w/]*\w\.(?:py|md|sh)")
OUTPUT = re.compile(r"^print\(.*\)\s+# (.*)$", re.MULTILINE)

NAMES_OF_THE_REPORT = """
    colour vec3f line getpoint lproperty rate throughrate reflectrate mirrrorate highlightrate s
    grain mapping single_grain line_grain paint interval cube_grain pic_grain filename direction high_grain
    obj plain ball poly tri tri_num
    scene light object weight overreflect addlight addobj
    camera height width dis focus depth buffer view stpoint xline yline img move x_rotate y_rotate draw show
""".split()


def page_id(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def prose(page: Path) -> str:
    """The page without its blocks of code."""
    return INDENTED.sub("", FENCE.sub("", page.read_text(encoding="utf-8")))


@cache
def anchors(page: Path) -> frozenset[str]:
    """The anchors of a page's headings, made as GitHub makes them."""
    titles = re.findall(r"^#+ (.*)$", FENCE.sub("", page.read_text(encoding="utf-8")), re.MULTILINE)
    return frozenset(re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles)


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_relative_links_resolve(page: Path) -> None:
    broken = []
    for target in LINK.findall(prose(page)):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        file = (page.parent / name).resolve() if name else page
        inside = file.is_relative_to(ROOT) and file.exists()
        if not inside or (anchor and anchor not in anchors(file)):
            broken.append(target)
    assert not broken


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_paths_in_the_text_exist(page: Path) -> None:
    code = " ".join(INLINE_CODE.findall(prose(page)))
    paths = [path for path in PATH.findall(code) if "NAME" not in path]
    assert not [path for path in paths if not (ROOT / path).exists()]


def glossary() -> list[list[str]]:
    """The cells of each row of the table in docs/model.md, section 1."""
    text = (ROOT / "docs" / "model.md").read_text(encoding="utf-8")
    section = text.partition("\n## 1. ")[2].partition("\n## 2. ")[0]
    rows = [line for line in section.splitlines() if line.startswith("| ")][1:]
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", row)[1:-1]] for row in rows]


def resolve(dotted: str) -> str:
    """The module that a name such as `tracer.camera.Camera.rotate` leads into; fails for a wrong one."""
    parts = dotted.split(".")
    for length in range(len(parts), 0, -1):
        name = ".".join(parts[:length])
        try:
            found: Any = importlib.import_module(name)
        except ModuleNotFoundError:
            continue
        for part in parts[length:]:
            if not hasattr(found, part):
                assert inspect.isclass(found) and part in fields_of(found), f"{dotted}: no {part}"
                return name
            found = getattr(found, part)
        return name
    raise AssertionError(f"{dotted}: no such module")


def fields_of(record: type) -> set[str]:
    """The annotated fields of a class and of its bases, which need not exist on the class itself."""
    return {name for base in record.__mro__ for name in base.__dict__.get("__annotations__", {})}


@pytest.mark.parametrize("row", glossary(), ids=lambda row: re.sub(r"[`*]", "", row[0]))
def test_names_of_the_glossary_exist(row: list[str]) -> None:
    names = INLINE_CODE.findall(row[2])
    linked = {(ROOT / "docs" / target).resolve() for target in LINK.findall(row[3])}
    assert names
    modules = [importlib.import_module(resolve(name)) for name in names]
    assert {Path(str(module.__file__)).resolve() for module in modules} == linked


def test_the_glossary_names_everything_in_the_report() -> None:
    first_column = " ".join(" ".join(INLINE_CODE.findall(row[0])) for row in glossary())
    words = set(re.findall(r"\w+", first_column))
    assert not [name for name in NAMES_OF_THE_REPORT if name not in words]


def test_the_tree_of_rooms_is_complete() -> None:
    """Names of modules in the tree exist, and every room directly below `tracer/` is in it."""
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    tree = text.partition("\n## The rooms\n")[2].partition("\n## ")[0]
    modules = [file for package in ("tracer", "reference") for file in (ROOT / package).rglob("*.py")]
    named = set(re.findall(r"\b\w+\.py\b", tree))
    assert named <= {file.name for file in modules}, "the tree names a module that is gone"
    files = {file.name for file in (ROOT / "tracer").glob("*.py")} - {"__init__.py"}
    folders = {file.parent.name for file in (ROOT / "tracer").glob("*/__init__.py")}
    assert not {*files - named, *(name for name in folders if f"{name}/" not in tree)}


def test_the_example_of_the_readme_prints_what_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    monkeypatch.chdir(tmp_path)
    exec(compile(example, "README.md", "exec"), {})
    expected = [line.strip() for line in OUTPUT.findall(example)]
    assert capsys.readouterr().out.splitlines() == expected
    assert (tmp_path / "ball.png").stat().st_size > 0


def command_lines() -> list[str]:
    """Every indented line of the pages that calls `tracer` with a command."""
    lines = [line.strip() for page in PAGES for line in INDENTED.findall(page.read_text(encoding="utf-8"))]
    return [line for line in lines if re.match(r"tracer [a-z]", line)]


@pytest.mark.parametrize("line", command_lines())
def test_command_lines_are_accepted(line: str) -> None:
    """The command, its options, their values and what it sets in a built-in scene; other files are the
    reader's."""
    name, *arguments = shlex.split(line, comments=True)[1:]
    command = cli.commands[name]
    context = command.make_context(name, list(arguments))
    for scene in builtin_scenes().keys() & set(context.params.get("scenes", ())):
        load(scene, overrides=context.params.get("overrides", ()))


def test_there_are_command_lines_to_test() -> None:
    assert len(command_lines()) >= 5


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_options_and_targets_in_the_text_exist(page: Path) -> None:
    code = " ".join(INLINE_CODE.findall(prose(page)))
    commands = [cli, *cli.commands.values()]
    known = {option for command in commands for option in options_of(command)}
    assert not [option for option in re.findall(r"(?<!\S)--[a-z-]+", code) if option not in known]
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z]+):", makefile, re.MULTILINE))
    assert not [target for target in re.findall(r"\bmake ([a-z]+)", code) if target not in targets]


def options_of(command: click.Command) -> list[str]:
    """The options of a command, as its `--help` lists them."""
    with click.Context(command) as context:
        return re.findall(r"(?<!\S)--[a-z-]+", command.get_help(context))
