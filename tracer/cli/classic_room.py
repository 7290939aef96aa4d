"""The document's room with the parts that were chosen, put together from the built-in classic scenes."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from tracer.assets import SCENES, builtin_scenes
from tracer.scene import Scene, load
from tracer.scene.merging import merged
from tracer.scene.toml_files import read_toml
from tracer.scene_warnings import finite_extents

PLAIN_COLOR = "#58a8b8"  # of the marble ball without its picture: one of the picture's own colors
CONTACT = (
    0.05  # a shape stands on another when the gap between them is below this share of the other's height
)


def load_room(choices: Mapping[str, bool], overrides: Sequence[str], allow_outside: bool = False) -> Scene:
    """The room for the choices of `tracer.cli.questions`; `overrides` are laid over it, as by `--set`.

    With all defaults it is the scene `classic`. Raises `SceneError`.
    """
    base = "classic_rabbit" if choices["rabbit"] else "classic"
    tree: dict[str, Any] = {}
    if choices["rotate"]:
        tree = read_toml(builtin_scenes()["classic_rotated"], "classic_rotated")
    tree["base"] = base
    merged(tree, _changes(load(builtin_scenes()[base]), choices))
    scene = load(tree, base_dir=SCENES, allow_outside=allow_outside, overrides=overrides)
    return scene.come_from(name="classic", label="classic", base_dir=SCENES, allow_outside=allow_outside)


def _changes(room: Scene, choices: Mapping[str, bool]) -> dict[str, Any]:
    """What is laid over the scene `room` for wallpaper, 3-D texture, tetrahedron and cube."""
    gone = [name for name in ("tetrahedron", "cube") if not choices[name]]
    changes: dict[str, Any] = {"remove": gone, "shapes": set_down(room, gone)}
    if not choices["trees"]:
        changes["textures"] = {"forest": {"file": room.to_dict()["textures"]["foxes"]["file"]}}
    if not choices["texture_3d"]:
        changes["shapes"].append({"name": "marble ball", "color": PLAIN_COLOR})
    return changes


def set_down(room: Scene, gone: Collection[str]) -> list[dict[str, Any]]:
    """What stood on shapes that are gone, lowered to where those stood; and what stood on that in turn."""
    extents = finite_extents(room)
    low = {number: (points - radius).min(axis=0) for number, (points, radius) in extents.items()}
    high = {number: (points + radius).max(axis=0) for number, (points, radius) in extents.items()}
    drops: dict[int, float] = {}
    for number in sorted(low, key=lambda number: float(low[number][1])):
        drops[number] = 0.0
        for under in list(drops):
            if under != number and _stands_on(low[number], high[number], low[under], high[under]):
                removed = room.shapes[under].name in gone
                height = float(low[number][1] - low[under][1]) if removed else 0.0
                drops[number] = max(drops[number], drops[under] + height)
    return [
        {"name": shape.name, "translate": [shape.translate[0], shape.translate[1] - drop, shape.translate[2]]}
        for shape, drop in ((room.shapes[number], drop) for number, drop in drops.items())
        if drop > 0 and shape.name not in gone
    ]


def _stands_on(low: np.ndarray, high: np.ndarray, under_low: np.ndarray, under_high: np.ndarray) -> bool:
    """Whether a shape's box ends where another's begins, with its middle above that."""
    gap = abs(low[1] - under_high[1])
    middle, across = (low + high) / 2, [0, 2]
    above = (under_low <= middle) & (middle <= under_high)
    return bool(gap <= CONTACT * (under_high[1] - under_low[1]) and above[across].all())
