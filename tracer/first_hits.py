"""What primary rays meet first, and which lights reach it, found before the loop in bundles of neighbors.

What else a primary ray meets, and how far all of it is, the loop finds as for other rays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from tracer.acceleration.bundles import DOUBTFUL, RAYS, answers_to, in_order
from tracer.acceleration.first_of_bundles import Bundles, nearest_of_bundles
from tracer.acceleration.triangle import TriangleTables
from tracer.canvas import Canvas, DeviceCanvas
from tracer.device_scene import DeviceScene
from tracer.first_shadows import first_shadows
from tracer.intersection import closest_triangle, free_ray
from tracer.pixels import Lanes, numbered_rays
from tracer.replay import Program

FEWEST_RAYS = 1 << 18
"""For fewer it takes longer to record the bundles than they save."""

SMALLEST_EDGE, SMALLEST_SHADOW_EDGE = 0.75, 1.0
"""Where a typical triangle is shorter than this many pixels, neighbors meet too many of them, seen from the
eye and from a light."""

SMALLEST_SHARE = 0.25
"""Where triangles take a smaller share of the picture, it takes as long to prepare bundles from a light as
they save."""


@dataclass
class FirstHits:
    """What primary rays meet, of all lanes for their first sub-ray, then for the next (lanes n n,): the
    `primitive` that is first among triangles (`INVALID`: none, `DOUBTFUL`: the loop has to find it), and
    where it is `HIDDEN` from the lights of `lights_asked`, a list that is empty where nobody has looked."""

    primitive: Any
    hidden: list[Any]


def first_hits(
    scene: DeviceScene, canvas: Canvas, device_canvas: DeviceCanvas, lanes: Lanes, n: int
) -> FirstHits | None:
    """What primary rays of a launch meet first; None in a scene without triangles.

    Whether bundles pay makes no difference to what is found.
    """
    if scene.triangles is None:
        return None
    index, rays = scene.backend.UInt32, lanes.count * n * n
    edge, share = _appearance(scene.triangles, canvas)
    if rays < FEWEST_RAYS or edge < SMALLEST_EDGE:
        return FirstHits(dr.opaque(index, DOUBTFUL, rays), [])

    def in_bundles(numbers: Any, both: bool) -> tuple[Any, Any]:
        found = bundled(scene, device_canvas, lanes, numbers, both)
        return found["primitive"], found["unknown"] == 1

    def single(numbers: Any) -> Any:
        return singly(scene, device_canvas, lanes, numbers)["primitive"]

    found = answers_to(index, rays, in_bundles, single)
    if edge < SMALLEST_SHADOW_EDGE or share < SMALLEST_SHARE:
        return FirstHits(found, [])
    return FirstHits(found, first_shadows(scene, device_canvas, lanes, found))


@Program
def bundled(
    scene: DeviceScene, canvas: DeviceCanvas, lanes: Lanes, numbers: Any, both: bool
) -> dict[str, Any]:
    """What the rays of bundles with these numbers meet, and 1 for those that it does not tell; see
    `nearest_of_bundles`. The rays of a bundle are neighbors, RAYS with consecutive numbers."""
    assert scene.triangles is not None
    backend = scene.backend
    rays = [numbered_rays(backend, canvas, lanes, numbers * RAYS + k)[1:] for k in range(RAYS)]
    bundles = Bundles.of(canvas.eye, rays)
    answers, unknown = nearest_of_bundles(backend, scene.triangles, bundles, both)
    return {"primitive": in_order(backend, answers), "unknown": dr.select(unknown, backend.UInt32(1), 0)}


@Program
def singly(scene: DeviceScene, canvas: DeviceCanvas, lanes: Lanes, numbers: Any) -> dict[str, Any]:
    """What the rays with these numbers meet, each by itself."""
    _, o, d = numbered_rays(scene.backend, canvas, lanes, numbers)
    everything = dr.full(scene.backend.Bool, True, len(numbers))
    return {"primitive": closest_triangle(scene, free_ray(scene, o, d), everything).primitive}


def _appearance(triangles: TriangleTables, canvas: Canvas) -> tuple[float, float]:
    """Length of a typical edge in the middle of all triangles, seen from the side, in pixels; and the share
    of the picture that the box around all takes, seen from any side, a quarter of its surface."""
    low, high = triangles.box
    away = float(np.linalg.norm((low + high) / 2 - canvas.eye))
    pixel = canvas.pixel_size / canvas.distance * away
    if pixel <= 0:
        return float("inf"), float("inf")
    x, y, z = (high - low) / pixel
    return triangles.typical_edge / pixel, (x * y + y * z + z * x) / 2 / (canvas.width * canvas.height)
