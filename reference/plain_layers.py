"""The layers of a picture a second time, from the trees of `reference.plain`.

Ids, normals, positions and coordinates are those of a pixel's nearest sub-ray. Visibility is the mean over
its sub-rays that hit something, the parts of the light over all of them; they add up to the working color.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from reference import plain
from reference.plain import BLACK, Camera, Node, PictureTexture, Surface, Vec, World, componentwise

UNKNOWN = Vec(math.nan, math.nan, math.nan)
PARTS = ("ambient", "diffuse", "specular", "reflected", "refracted")


def layers(
    world: World, scale: float = 1.0, supersample: int | None = None
) -> dict[str, NDArray[np.float64]]:
    """All layers of the whole picture, (h, w) or (h, w, components)."""
    camera = plain.scaled(world.camera, scale)
    n = supersample or camera.supersample
    pixels = [pixel(world, camera, n, i, j) for j in range(camera.height) for i in range(camera.width)]
    size = (camera.height, camera.width)
    columns = {name: np.array([values[name] for values in pixels], np.float64) for name in pixels[0]}
    return {name: column.reshape(*size, *column.shape[1:]) for name, column in columns.items()}


def pixel(world: World, camera: Camera, n: int, i: int, j: int) -> dict[str, object]:
    """The layers of one pixel."""
    counts = plain.new_counts()
    nodes = [plain.trace_sub_ray(world, camera, n, i, j, a, b, counts) for b in range(n) for a in range(n)]
    kinds = ("primary", "shadow", "reflected", "refracted", "total_reflection")
    found: dict[str, object] = {
        "level": counts["deepest_level"],
        "rays": sum(counts[kind] for kind in kinds),
        "visibility": visibility(nodes, len(world.lights)),
    }
    parts = [parts_of(world, node) for node in nodes]
    found |= {name: sum((part[name] for part in parts), BLACK) / len(nodes) for name in PARTS}
    nearest = min(nodes, key=lambda node: node.t)
    return found | {name: layer(world, nearest.surface) for name, layer in AT_HIT.items()}


def visibility(nodes: Sequence[Node], lights: int) -> Sequence[float]:
    """Share of each light that arrives; NaN where nothing is hit."""
    seen = [node.arriving for node in nodes if node.surface]
    return [math.fsum(column) / len(seen) for column in zip(*seen, strict=True)] or [math.nan] * lights


def parts_of(world: World, node: Node) -> dict[str, Vec]:
    """The summands of a primary ray's color; the background is ambient light."""
    if node.surface is None:
        return dict.fromkeys(PARTS, BLACK) | {"ambient": node.color}
    a, material = world.ambient, node.surface.material
    passed = (1 - a) * node.surface.color
    direct = material.absorption * passed
    parts = {
        "ambient": a * node.surface.color,
        "diffuse": material.diffuse * componentwise(direct, node.diffuse_light),
        "specular": material.specular * componentwise(direct, node.specular_light),
        "reflected": BLACK,
        "refracted": BLACK,
    }
    for child in node.children:
        branch = "reflected" if child.kind == "reflected" else "refracted"
        parts[branch] = child.factor * componentwise(passed, child.color)
    return parts


def coordinates(world: World, surface: Surface) -> tuple[float, float]:
    """u, v of the picture before it tiles; NaN for other textures."""
    shape, p = world.shapes[surface.hit.shape], surface.hit.position
    if not isinstance(shape.texture, PictureTexture):
        return math.nan, math.nan
    return shape.texture.uv(shape.frame.inverse(p) if shape.frame else p)


def at_hit(
    value: Callable[[World, Surface], object], blank: object
) -> Callable[[World, Surface | None], object]:
    """A layer of the nearest hit."""
    return lambda world, surface: blank if surface is None else value(world, surface)


AT_HIT = {
    "normal": at_hit(lambda _, surface: surface.shading, UNKNOWN),
    "Ng": at_hit(lambda _, surface: surface.hit.normal, UNKNOWN),
    "position": at_hit(lambda _, surface: surface.hit.position, UNKNOWN),
    "shape": at_hit(lambda _, surface: surface.hit.shape, -1),
    "primitive": at_hit(lambda _, surface: surface.hit.primitive, -1),
    "uv": at_hit(coordinates, (math.nan, math.nan)),
}
