"""What primary rays meet first, and which lights reach it, found before the loop in bundles of neighbors.

What else a primary ray meets, and how far all of it is, the loop finds as for other rays.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import drjit as dr
import numpy as np

from tracer.acceleration.bundles import DOUBTFUL, RAYS, Found, answers_to
from tracer.acceleration.first_of_bundles import HELD, Bundles, nearest_of_bundles
from tracer.acceleration.nearby import Nearby
from tracer.acceleration.traverse import visit_triangles
from tracer.acceleration.triangle import TriangleTables
from tracer.backends import INVALID
from tracer.canvas import Canvas, DeviceCanvas
from tracer.device_scene import DeviceScene
from tracer.first_shadows import first_shadows, lights_asked
from tracer.intersection import closest_triangle, free_ray, known_triangle
from tracer.leaving import departure
from tracer.pixels import Lanes, numbered_rays
from tracer.ray import Hit, Ray, keep_nearer, no_hit, select_min
from tracer.replay import FirstTimes, Program
from tracer.surface import slot_of

FEWEST_RAYS = 1 << 18
"""For fewer it takes longer to record the bundles than they save."""

SMALLEST_EDGE, SMALLEST_SHADOW_EDGE = 0.75, 1.0
"""Where a typical triangle is shorter than this many pixels, neighbors meet too many of them, seen from the
eye and from a light."""

SMALLEST_SHARE = 0.25
"""Where triangles take a smaller share of the picture, it takes as long to prepare bundles from a light as
they save."""

FEW_RAYS = 8 * RAYS
"""Bundles are asked of so many, as many as the smallest launch has, where they do not pay and only their
kernels are wanted."""

_FIRST_TIME = FirstTimes()


@dataclass
class FirstHits:
    """What primary rays meet, of all lanes for their first sub-ray, then for the next (lanes n n,): the
    `slot` of the triangle that is first (`INVALID`: none, `DOUBTFUL`: the loop has to find it), and
    for each of `lights_asked` where it is `HIDDEN` from that (or `DOUBTFUL`), a list that is empty where
    nobody has looked."""

    slot: Any
    hidden: list[Any]


def enough_for_bundles(rays: int) -> bool:
    """Whether bundles may pay for so many rays."""
    return rays >= FEWEST_RAYS


def first_hits(
    scene: DeviceScene,
    canvas: Canvas,
    device_canvas: DeviceCanvas,
    lanes: Lanes,
    n: int,
    animated: bool = False,
) -> FirstHits | None:
    """What primary rays of a launch meet first; None in a scene without triangles.

    Whether bundles pay makes no difference to what is found. `animated`: and none to which kernels the first
    launch needs, so that no later one needs others.
    """
    if scene.triangles is None:
        return None
    index, rays = scene.backend.UInt32, lanes.count * n * n
    edge, share = _appearance(scene.triangles, canvas)
    pay = enough_for_bundles(rays) and edge >= SMALLEST_EDGE
    shadows_pay = pay and edge >= SMALLEST_SHADOW_EDGE and share >= SMALLEST_SHARE
    every_kernel = animated and _FIRST_TIME(scene, device_canvas, lanes)

    def found_in_bundles(rays: int) -> Any:
        return answers_to(
            index,
            rays,
            lambda numbers, both: Found(**bundled(scene, device_canvas, lanes, numbers, both)),
            lambda found, places, numbers: among(scene, device_canvas, lanes, found, places, numbers)["slot"],
            lambda numbers: singly(scene, device_canvas, lanes, numbers)["slot"],
            every_kernel,
        )

    if every_kernel and not pay:
        found_in_bundles(FEW_RAYS)
    slot = found_in_bundles(rays) if pay else dr.opaque(index, DOUBTFUL, rays)
    if shadows_pay:
        return FirstHits(slot, first_shadows(scene, device_canvas, lanes, slot, every_kernel))
    if every_kernel:
        first_shadows(scene, device_canvas, lanes, dr.opaque(index, INVALID, FEW_RAYS), every_kernel)
    lights = lights_asked(scene) if animated else []
    return FirstHits(slot, [dr.opaque(index, DOUBTFUL, rays) for _ in lights])


@Program
def bundled(
    scene: DeviceScene, canvas: DeviceCanvas, lanes: Lanes, numbers: Any, both: bool
) -> dict[str, Any]:
    """What the rays of bundles with these numbers meet, as in `Found`. The rays of a bundle are neighbors,
    RAYS with consecutive numbers."""
    assert scene.triangles is not None
    backend = scene.backend
    rays = [numbered_rays(backend, canvas, lanes, numbers * RAYS + k)[1:] for k in range(RAYS)]
    return vars(nearest_of_bundles(backend, scene.triangles, Bundles.of(canvas.eye, rays), both))


@Program
def among(
    scene: DeviceScene, canvas: DeviceCanvas, lanes: Lanes, found: Found, places: Any, numbers: Any
) -> dict[str, Any]:
    """What the rays with these numbers meet, as far as their bundles tell; see `nearest_among`."""
    _, o, d = numbered_rays(scene.backend, canvas, lanes, numbers)
    return {"slot": nearest_among(scene, free_ray(scene, o, d), found, places)}


def nearest_among(scene: DeviceScene, ray: Ray, found: Found, places: Any) -> Any:
    """The slot of the triangle that rays (n,) meet first, by the answers and candidates in these places of
    what bundles found; `DOUBTFUL` where these do not tell enough."""
    assert scene.triangles is not None
    known = dr.gather(type(places), found.answers, places)
    answered = known != DOUBTFUL
    nothing = no_hit(scene.backend, dr.width(places))
    ray = Nearby.of(scene.backend, scene.triangles.lists, ray).ray

    def visit(state: Any, t: Any, primitive: Any, _test: Any, valid: Any) -> Any:
        hit, hoped = state
        return keep_nearer(hit, t, valid, primitive), select_min(dr.select(t > 0, t, hoped), hoped)

    hit, hoped = visit_triangles(
        scene.backend,
        scene.triangles,
        ray,
        lambda: departure(scene, ray, True),
        state=(known_triangle(scene, ray, nothing, answered, known), nothing.t),
        limit=lambda state: state[0].t,
        visit=visit,
        active=answered,
        among=partial(found.fold, places),
    )
    return dr.select(answered & (hit.t <= hoped * HELD), slot_of_hit(scene, hit), DOUBTFUL)


@Program
def singly(scene: DeviceScene, canvas: DeviceCanvas, lanes: Lanes, numbers: Any) -> dict[str, Any]:
    """What the rays with these numbers meet, each by itself."""
    _, o, d = numbered_rays(scene.backend, canvas, lanes, numbers)
    everything = dr.full(scene.backend.Bool, True, len(numbers))
    return {"slot": slot_of_hit(scene, closest_triangle(scene, free_ray(scene, o, d), everything))}


def slot_of_hit(scene: DeviceScene, hit: Hit) -> Any:
    """The slot of the triangle that is hit, `INVALID` for none."""
    return dr.select(hit.valid, slot_of(scene, hit.primitive, hit.valid), INVALID)


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
