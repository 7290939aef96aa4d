"""Changes of single numbers and colors of a scene by their path, and what hangs together with them."""

from __future__ import annotations

from typing import Any

from tracer.material import Material
from tracer.scene import Scene
from tracer.scene.keyed import child_of
from tracer.viewer.controls import SHARES, Path

Rgb = tuple[float, float, float]
"""A color as it stands in a scene: display-referred sRGB, each from 0 to 1."""

Edits = dict[Path, float | Rgb]
"""Values by path, as they are stated in the scene; the share k_a of a material is never stated."""


def value_at(scene: Scene, path: Path) -> float | Rgb | None:
    """The number or color at a path of a scene; None where there is none."""
    value: Any = scene
    for part in path:
        try:
            value = _below(value, part)
        except (AttributeError, IndexError, KeyError, TypeError, ValueError):
            return None
    if isinstance(value, tuple) and len(value) == 3:
        return value
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else None


def set_value(scene: Scene, path: Path, value: float | Rgb) -> None:
    """Sets a number or color of a scene; raises `SceneError` where the record refuses it."""
    *way, last = path
    if isinstance(last, int):  # a part of a tuple, which is set as a whole
        *way, key = way
        record = _record_at(scene, way)
        vector = list(getattr(record, str(key)))
        vector[last] = value
        setattr(record, str(key), tuple(vector))
    else:
        setattr(_record_at(scene, way), last, value)


def applied(scene: Scene, edits: Edits) -> None:
    """Makes those edits of a scene that have a place in it; shares of a material must be able to pass through
    each other, so all are lowered first."""
    here = {path: value for path, value in edits.items() if value_at(scene, path) is not None}
    for path in here:
        if path[-1] in SHARES:
            set_value(scene, path, 0.0)
    for path, value in here.items():
        set_value(scene, path, value)


def consequences(scene: Scene, path: Path, value: float) -> Edits:
    """The edits that a control asks for: itself, and of a material's shares both that are stated."""
    if path[-1] not in SHARES:
        return {path: value}
    material = scene.materials[str(path[1])]
    shares = _balanced(material, str(path[-1]), value)
    return {(*path[:2], key): share for key, share in zip(SHARES, shares, strict=False)}


def _balanced(material: Material, key: str, value: float) -> tuple[float, float]:
    """k_r and k_t after one of k_r, k_t, k_a was moved: the other two keep their proportion, so that the sum
    stays 1; where they were both 0, the rest goes to k_a, or from k_a to k_r."""
    k_r, k_t, k_a = material.reflection, material.refraction, material.absorption
    rest = 1.0 - value
    if key == "reflection":
        others = k_t + k_a
        return value, rest * k_t / others if others > 0 else 0.0
    if key == "refraction":
        others = k_r + k_a
        return (rest * k_r / others if others > 0 else 0.0), value
    others = k_r + k_t
    return (rest * k_r / others, rest * k_t / others) if others > 0 else (rest, 0.0)


def _record_at(scene: Scene, way: list[str | int]) -> Any:
    record: Any = scene
    for part in way:
        record = _below(record, part)
    return record


def _below(node: Any, part: str | int) -> Any:
    """What a step leads to: in lists also by name."""
    if isinstance(node, list) and isinstance(part, str):
        part = [entry.name for entry in node].index(part)
    return child_of(node, part)
