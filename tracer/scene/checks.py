"""The checks that need more than one record: names, references, weights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from tracer.lights import LightRecord
from tracer.messages import Refusal, show, suggestion
from tracer.shapes import Instance, Mesh, ShapeRecord


class Tables(Protocol):
    """What the references of shapes point into."""

    textures: dict[str, Any]
    materials: dict[str, Any]
    shapes: list[Any]


def check_lights(lights: Sequence[LightRecord]) -> None:
    """Raise `Refusal` where names repeat or no light has a weight."""
    _check_unique([light.name for light in lights], "lights")
    if lights and not any(light.weight > 0 for light in lights):
        raise Refusal("have weights that are all 0; allowed: at least one weight greater than 0", "lights")


def check_shapes(scene: Tables) -> None:
    """Raise `Refusal` where names repeat or a shape refers to something that is not there."""
    _check_unique([shape.name for shape in scene.shapes], "shapes")
    meshes = _meshes(scene)
    for number, shape in enumerate(scene.shapes):
        _check_references(number, shape, scene, meshes)


def check_one_shape(number: int, shape: ShapeRecord, scene: Tables) -> None:
    """The same for a shape that is about to become number `number` of the scene."""
    if shape.name is not None:
        _check_unique([*(other.name for other in scene.shapes), shape.name], "shapes")
    _check_references(number, shape, scene, _meshes(scene) if isinstance(shape, Instance) else {})


def _meshes(scene: Tables) -> dict[str, Any]:
    return {shape.name: shape for shape in scene.shapes if isinstance(shape, Mesh) and shape.name is not None}


def _check_unique(names: Sequence[str | None], key: str) -> None:
    seen: dict[str, int] = {}
    for number, name in enumerate(names):
        if name is None:
            continue
        if name in seen:
            raise Refusal(f"is {show(name)}, the name of `{key}.{seen[name]}` already", key, number, "name")
        seen[name] = number


def _check_references(number: int, shape: ShapeRecord, scene: Tables, meshes: Mapping[str, Any]) -> None:
    for key, what, table in (
        ("material", "material", scene.materials),
        ("texture", "texture", scene.textures),
    ):
        _check_reference(getattr(shape, key), what, table, ("shapes", number, key))
    if isinstance(shape, Instance):
        _check_reference(shape.of, "mesh", meshes, ("shapes", number, "of"))


def _check_reference(
    name: str | None, what: str, table: Mapping[str, Any], path: tuple[str | int, ...]
) -> None:
    if name is not None and name not in table:
        raise Refusal(
            f"is {show(name)}, which is no {what} of this scene; {suggestion(name, table, what)}", *path
        )
