"""The steps of the tutorial add up to the file that they are taken from."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import pytest

import tracer
from tracer.assets import SCENES
from tracer.scene.toml_files import parse_toml

ROOT = Path(__file__).resolve().parents[2]
ADDED = re.compile(r"^```\{scene-step\}\n:add: (.*)$", re.MULTILINE)


@pytest.fixture
def scene_file(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The module that cuts scene files; it is part of the site's tools, not of the package."""
    monkeypatch.syspath_prepend(ROOT / "docs")
    import tracer_docs.scene_file

    yield tracer_docs.scene_file
    for name in [name for name in sys.modules if name.split(".")[0] == "tracer_docs"]:
        del sys.modules[name]


def steps() -> list[list[str]]:
    """The patterns of each step."""
    page = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
    return [[pattern.strip() for pattern in line.split(",")] for line in ADDED.findall(page)]


def test_every_step_is_a_scene_and_the_last_is_the_classic_room(scene_file: Any) -> None:
    growing = scene_file.Growing(SCENES / "classic.toml")
    assert 7 <= len(steps()) <= 10
    for patterns in steps():
        assert growing.add(patterns)
        scene = tracer.load(parse_toml(growing.text, "step"), base_dir=SCENES)
    assert growing.missing == []
    assert scene.to_dict() == tracer.load("classic").to_dict()


@pytest.mark.parametrize("path", sorted(SCENES.glob("*.toml")), ids=lambda path: path.stem)
def test_the_tables_of_a_file_are_the_file(scene_file: Any, path: Path) -> None:
    text = "\n\n".join(table.text for table in scene_file.read_tables(path))
    assert parse_toml(text, path.name) == parse_toml(path.read_text(encoding="utf-8"), path.name)


def test_a_table_brings_what_it_names(scene_file: Any, tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(
        "# The comment of the file.\n\nambient = 0.5\n\n"
        '# Of the matte.\n[materials.matte]\ndiffuse = 1.0\n\n[textures."a b"]\nkind = "solid"\n'
        'color = "#fff"\n\n[[shapes]]\nname = "ball"\nkind = "sphere"\nmaterial = "matte"\ntexture = "a b"\n'
        '\n[[lights]]\nname = "sun"\nkind = "point"\nposition = [\n1.0,\n2.0, 3.0]\n'
    )
    growing = scene_file.Growing(path)
    added = growing.add(["shapes.*(sphere)"])
    assert [table.key for table in added] == ["materials.matte", "textures.a b", "shapes.ball"]
    assert added[0].text == "# Of the matte.\n[materials.matte]\ndiffuse = 1.0"
    assert growing.missing == ["options", "lights.sun"]
    assert scene_file.value_at(growing.tables, "materials.matte.diffuse") == 1.0
    with pytest.raises(LookupError, match=r"scene\.toml: 'shapes\.\*' adds no table"):
        growing.add(["shapes.*"])
    with pytest.raises(LookupError, match=r"the scene has no 'shapes\.ball\.radius'"):
        scene_file.value_at(growing.tables, "shapes.ball.radius")
