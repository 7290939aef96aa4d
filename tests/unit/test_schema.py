"""The JSON schema of scene files tells right from wrong ones, also where a file changes another one."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from jsonschema import Draft202012Validator

import tracer
from tracer.assets import builtin_scenes
from tracer.scene.toml_files import read_toml

VALIDATOR = Draft202012Validator(tracer.json_schema())
BALL = {"name": "ball", "kind": "sphere", "center": [0, 0, 0], "radius": 1}
WHOLE: dict[str, Any] = {
    "camera": {"depth_of_field": {"focus": 5.0}},
    "lights": [{"kind": "point", "position": [0, 9, 0]}],
    "textures": {"checks": {"kind": "checker", "colors": ["#fff", [0, 0, 0]], "interval": 1}},
    "materials": {"glass": {"ior": 1.5}},
    "shapes": [BALL],
    "animation": [{"key": "ambient", "times": [0, 1], "values": [0, 1]}],
}
PARTS: tuple[dict[str, Any], ...] = (
    {"shapes": [{"name": "ball", "color": "#fff"}]},
    {"shapes": [{"name": "ball", "kind": "sphere", "radius": 2}]},
    {"lights": [{"name": "lamp", "weight": 2.0}]},
    {"textures": {"checks": {"interval": 2}}},
    {"camera": {"depth_of_field": {"samples": 3}}},
    {"animation": [{"key": "ambient", "values": [1, 0]}]},
)
WRONG: tuple[dict[str, Any], ...] = (
    {"shapes": [{"name": "ball", "radus": 2}]},
    {"shapes": [{"name": "ball", "kind": "plane", "radius": 2}]},
    {"shapes": [{"name": "ball", "radius": -2}]},
    {"lights": [{"name": "lamp", "kind": "spot"}]},
    {"textures": {"checks": {"interval": 0}}},
    {"camera": {"depth_of_field": {"sample": 3}}},
    {"remove": "ball"},
    {"shapez": []},
)


def valid(scene: dict[str, Any]) -> bool:
    return VALIDATOR.is_valid(scene)


def test_it_is_a_schema() -> None:
    Draft202012Validator.check_schema(tracer.json_schema())


@pytest.mark.parametrize("name", builtin_scenes())
def test_builtin_scenes_are_valid(name: str) -> None:
    assert valid(read_toml(builtin_scenes()[name], name))


def test_a_whole_scene_is_valid() -> None:
    assert valid(WHOLE) and valid(WHOLE | {"base": "other.toml", "remove": ["cube"]})
    tracer.load(WHOLE)


@pytest.mark.parametrize("part", PARTS, ids=str)
def test_parts_are_valid_only_over_a_base(part: dict[str, Any]) -> None:
    assert valid(part | {"base": "other.toml"}) and not valid(part)


@pytest.mark.parametrize("wrong", WRONG, ids=str)
def test_what_is_wrong_is_wrong_over_a_base_too(wrong: dict[str, Any]) -> None:
    assert not valid(wrong) and not valid(wrong | {"base": "other.toml"})


@pytest.mark.parametrize("place", ["lights", "textures", "shapes"])
def test_a_kind_is_required(place: str) -> None:
    scene = copy.deepcopy(WHOLE)
    entries = scene[place]
    del (entries["checks"] if isinstance(entries, dict) else entries[0])["kind"]
    assert not valid(scene)
    with pytest.raises(tracer.SceneError, match="kind` is missing"):
        tracer.load(scene)
