"""The triangle that each primary ray meets first, found before the loop in bundles of neighbors.

What else a primary ray meets, and how far all of it is, the loop finds as for other rays.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np

from tracer.acceleration.bundles import DOUBTFUL, RAYS, Bundles, nearest_of_neighbors, settle_doubtful
from tracer.acceleration.triangle import TriangleTables
from tracer.backends import Backend
from tracer.canvas import Canvas, DeviceCanvas
from tracer.device_scene import DeviceScene
from tracer.intersection import closest_triangle, free_ray
from tracer.pixels import BandPlace, pixels_of, primary_ray
from tracer.replay import Program
from tracer.tiles import lane_count

FEWEST_RAYS = 1 << 18
"""For fewer it takes longer to record the bundles than they save."""

SMALLEST_EDGE = 0.75
"""Where a typical triangle is shorter than this many pixels, neighbors meet too many of them."""


def first_triangles(
    scene: DeviceScene,
    canvas: Canvas,
    device_canvas: DeviceCanvas,
    place: BandPlace,
    size: tuple[int, int],
    n: int,
) -> Any:
    """The primitives (lanes n n,) that primary rays of a band meet first among triangles: of all lanes for
    their first sub-ray, then for the next. `INVALID`: none; `DOUBTFUL`: the loop has to find it. None in a
    scene without triangles.

    Whether bundles pay makes no difference to what is found.
    """
    if scene.triangles is None:
        return None
    index, rays = scene.backend.UInt32, lane_count(*size) * n * n
    if rays < FEWEST_RAYS or _edge_in_pixels(scene.triangles, canvas) < SMALLEST_EDGE:
        return dr.opaque(index, DOUBTFUL, rays)
    found = bundled(scene, device_canvas, place, size, rays)["primitive"]
    settle_doubtful(found, lambda numbers: singly(scene, device_canvas, place, size, numbers)["primitive"])
    return found


@Program
def bundled(
    scene: DeviceScene, canvas: DeviceCanvas, place: BandPlace, size: tuple[int, int], rays: int
) -> dict[str, Any]:
    """What so many rays meet, in bundles; see `nearest_of_neighbors`."""
    assert scene.triangles is not None

    def bundles_of(bundle: Any) -> Bundles:
        rays = [_ray_of(scene.backend, canvas, place, size, bundle * RAYS + k) for k in range(RAYS)]
        return Bundles.of(canvas.eye, rays)

    primitive = nearest_of_neighbors(scene.backend, scene.triangles, rays, bundles_of)
    return {"primitive": primitive}


@Program
def singly(
    scene: DeviceScene, canvas: DeviceCanvas, place: BandPlace, size: tuple[int, int], numbers: Any
) -> dict[str, Any]:
    """What the rays with these numbers meet, each by itself."""
    o, d = _ray_of(scene.backend, canvas, place, size, numbers)
    everything = dr.full(scene.backend.Bool, True, len(numbers))
    return {"primitive": closest_triangle(scene, free_ray(scene, o, d), everything).primitive}


def _ray_of(
    backend: Backend, canvas: DeviceCanvas, place: BandPlace, size: tuple[int, int], number: Any
) -> tuple[Any, Any]:
    """Origins and directions (3, n) of rays by number: sub-ray times lanes plus lane."""
    launch = backend.opaque_id(lane_count(*size))
    sub_ray = number // launch
    return primary_ray(backend, canvas, pixels_of(backend, place, size, number - sub_ray * launch), sub_ray)


def _edge_in_pixels(triangles: TriangleTables, canvas: Canvas) -> float:
    """Length of a typical edge in the middle of all triangles, seen from the side, in pixels."""
    away = float(np.linalg.norm(triangles.middle - canvas.eye))
    pixel = canvas.pixel_size / canvas.distance * away
    return triangles.typical_edge / pixel if pixel > 0 else float("inf")
