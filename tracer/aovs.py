"""Layers: of the nearest sub-ray's hit, computed again from the pixel and the primitive and not carried by
the loop; of the counts of rays; and the sums of `tracer.sums`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import drjit as dr

from tracer.canvas import DeviceCanvas
from tracer.device_scene import DeviceScene
from tracer.film.layout import VISIBILITY
from tracer.intersection import free_ray
from tracer.pixels import PixelGrid, primary_ray
from tracer.ray import Hit
from tracer.spawn import material_at
from tracer.sums import PARTS
from tracer.surface import Surface, surface_at
from tracer.textures.tables import PICTURE, picture_coordinates
from tracer.whitted import Counts, PixelColumns, texture_point

Layer = Callable[[DeviceScene, Surface, Any, Any], Any]
"""(scene, surface, primitive, mask of hits) -> values (n,) or (components, n)."""


def _vector(pick: Callable[[Surface], Any]) -> Layer:
    return lambda scene, surface, primitive, found: dr.select(found, pick(surface), float("nan"))


def _shape(scene: DeviceScene, surface: Surface, primitive: Any, found: Any) -> Any:
    return dr.select(found, scene.backend.Int32(surface.shape), -1)


def _primitive(scene: DeviceScene, surface: Surface, primitive: Any, found: Any) -> Any:
    backend = scene.backend
    first = dr.gather(backend.UInt32, scene.first_primitive, surface.shape, found)
    return dr.select(found, backend.Int32(primitive - first), -1)


def _uv(scene: DeviceScene, surface: Surface, primitive: Any, found: Any) -> Any:
    nothing = scene.backend.Vector2(float("nan"))
    if PICTURE not in scene.textures.kinds:
        return dr.select(found, nothing, nothing)
    row = material_at(scene, surface, found).texture
    has_picture = found & (row.kind == PICTURE)
    point = texture_point(scene, surface, found)
    uv = picture_coordinates(scene.backend, scene.textures, row, point, has_picture)
    return dr.select(has_picture, uv, nothing)


LAYERS: dict[str, Layer] = {
    "normal": _vector(lambda surface: surface.normal),
    "Ng": _vector(lambda surface: surface.outward),
    "position": _vector(lambda surface: surface.p),
    "shape": _shape,
    "primitive": _primitive,
    "uv": _uv,
}
"""A new layer of the first hit is one line here."""

COUNTS: dict[str, Callable[[Counts, Any], Any]] = {
    "level": lambda counts, sub_rays: counts.deepest_level,
    "rays": lambda counts, sub_rays: (
        sub_rays + counts.shadow + counts.reflected + counts.refracted + counts.total_reflection
    ),
}
"""Layers that are made of a pixel's counts, and of the number of its sub-rays."""

NAMES = (*LAYERS, VISIBILITY, *COUNTS, *PARTS)
"""All layers but the depth, which every picture has."""


def compute_layers(
    scene: DeviceScene, canvas: DeviceCanvas, pixels: PixelGrid, found: PixelColumns, names: Sequence[str]
) -> dict[str, Any]:
    """Values of the layers for the pixels of a launch, (n,) or one for each component."""
    values = dict(found.sums)
    values |= {name: COUNTS[name](found.counts, pixels.n * pixels.n) for name in names if name in COUNTS}
    at_hit = [name for name in names if name in LAYERS]
    return values | (_at_first_hits(scene, canvas, pixels, found, at_hit) if at_hit else {})


def _at_first_hits(
    scene: DeviceScene, canvas: DeviceCanvas, pixels: PixelGrid, found: PixelColumns, names: Sequence[str]
) -> dict[str, Any]:
    """NaN and -1 where nothing was hit."""
    backend = scene.backend
    o, d = primary_ray(backend, canvas, pixels, found.sub_ray)
    valid = found.depth >= 0
    ray = free_ray(scene, o, d)
    surface = surface_at(scene, ray, Hit(found.depth, found.primitive), valid)
    return {name: LAYERS[name](scene, surface, found.primitive, valid) for name in names}
