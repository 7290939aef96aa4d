"""The scenes of the benchmark: the room, alone and with meshes and spheres that a seed decides."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import tracer
from reference.bench.icosphere import icosphere, write_ply
from tracer.scene import load

SEED = 20
MESHES = {"3k": 12, "82k": 64, "330k": 128, "1.3M": 256}
"""Displaced icospheres by their number of triangles, 20 times the square of the frequency."""

MESH_CENTER, MESH_RADIUS = [280.0, 800.0, -650.0], 200.0
BALLS = 1000


@dataclass(frozen=True)
class Workshop:
    """Where scenes are made: `folder` for meshes, which nothing else sees."""

    folder: Path

    def mesh(self, size: str) -> Path:
        """The file of a mesh, written when it is first asked for."""
        file = self.folder / f"{size}.ply"
        if not file.exists():
            write_ply(file, *icosphere(MESHES[size], SEED))
        return file

    def scene(self, tree: dict[str, Any]) -> tracer.Scene:
        """A scene from a dict whose files lie in the folder."""
        return load(tree, base_dir=self.folder, allow_outside=True)


Maker = Callable[[Workshop, int], tracer.Scene]
"""A scene in a picture so many pixels across."""


def room(workshop: Workshop, pixels: int, more: tuple[dict[str, Any], ...] = (), **keys: Any) -> tracer.Scene:
    """The benchmark room with more shapes and other keys."""
    return workshop.scene(room_tree(pixels, more) | keys)


def room_tree(pixels: int, more: tuple[dict[str, Any], ...] = ()) -> dict[str, Any]:
    """The room as a dict."""
    tree = sized(load("room"), pixels)
    tree["shapes"] = [*tree["shapes"], *more]
    return tree


def sized(scene: tracer.Scene, pixels: int) -> dict[str, Any]:
    """A scene as a dict, its picture so many pixels across, one ray each, the framing kept."""
    tree = scene.to_dict()
    camera = dict(tree["camera"])
    width, height = scene.camera.resolution
    camera["resolution"] = [pixels, max(1, round(height * pixels / width))]
    if not scene.camera.is_look_at:
        camera["pixel_size"] = scene.camera.pixel_size * width / pixels
    camera["supersample"] = 1
    camera.pop("depth_of_field", None)
    return {**tree, "camera": camera}


def with_mesh(workshop: Workshop, pixels: int, size: str, material: str | None = None) -> tracer.Scene:
    """The room with a displaced icosphere in the air."""
    shape: dict[str, Any] = {
        "name": "blob",
        "kind": "mesh",
        "file": workshop.mesh(size).name,
        "scale": MESH_RADIUS,
        "translate": MESH_CENTER,
        "color": "#c8b090",
    }
    return room(workshop, pixels, (shape | ({"material": material} if material else {}),))


def mesh_alone(workshop: Workshop, size: str) -> tracer.Scene:
    """One mesh of unit size, nothing else: what queries are asked of."""
    return workshop.scene({"shapes": [{"kind": "mesh", "file": workshop.mesh(size).name}]})


def spheres(workshop: Workshop, pixels: int) -> tracer.Scene:
    """The room with a thousand small balls in the air, every fourth a mirror."""
    rng = np.random.default_rng(SEED)
    cells = np.stack(np.meshgrid(*[np.arange(10)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    centers = np.array([-800, 60, -1400]) + np.array([160, 110, 120]) * (
        cells + rng.uniform(0.35, 0.65, (BALLS, 3))
    )
    balls = [
        {
            "kind": "sphere",
            "center": center.tolist(),
            "radius": float(radius),
            "color": color.tolist(),
            **({"material": "mirror"} if number % 4 == 0 else {}),
        }
        for number, (center, radius, color) in enumerate(
            zip(centers, rng.uniform(15, 38, BALLS), rng.uniform(0.3, 1, (BALLS, 3)), strict=True)
        )
    ]
    return room(workshop, pixels, tuple(balls))


def lights(workshop: Workshop, pixels: int, count: int) -> tracer.Scene:
    """The room under so many point lights of equal weight, on a spiral above."""
    k = np.arange(count)
    away, angle = 650 * np.sqrt((k + 0.5) / count), 2.39996 * k
    places = np.column_stack([away * np.cos(angle), 1300 + 0 * k, -500 + away * np.sin(angle)])
    return room(workshop, pixels, lights=[{"kind": "point", "position": place.tolist()} for place in places])


def mirrors(workshop: Workshop, pixels: int, depth: int) -> tracer.Scene:
    """Mirrors all around, so that every path is `depth` reflections long."""
    return workshop.scene(sized(load("optics_mirror_box"), pixels) | {"max_depth": depth})


SCENES: dict[str, Maker] = {
    "room": room,
    **{f"room-{size}": partial(with_mesh, size=size) for size in MESHES},
    "mirrors-82k": partial(with_mesh, size="82k", material="mirror"),
    "spheres": spheres,
}


def maker_of(name: str) -> Maker:
    """The scene of that name, else a scene file or a built-in scene; raises `SceneError`."""
    if name in SCENES:
        return SCENES[name]
    scene = load(name)
    return lambda workshop, pixels: load(sized(scene, pixels), base_dir=scene.base_dir, allow_outside=True)
