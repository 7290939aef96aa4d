"""Which lights triangles hide from the points that primary rays meet first, found before the loop in bundles.

For lights of one sample that stand in the kernel one by one; the loop asks about all others, about what other
shapes hide, and about points that other rays meet.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import drjit as dr

from tracer.acceleration.bundles import DOUBTFUL, Found, answers_to, neighboring_points, neighbors
from tracer.acceleration.shadows_of_bundles import HIDDEN, LIT, LitPoints, certain_reach, hidden_points
from tracer.acceleration.traverse import Fold
from tracer.arrival import segment_to
from tracer.canvas import DeviceCanvas
from tracer.device_scene import DeviceScene
from tracer.few_lights import may_be_lit
from tracer.intersection import Known, closest_hit, free_ray
from tracer.light_tables import LightSample, UnrolledLight
from tracer.occlusion import hidden_by_plane, hidden_by_triangle
from tracer.pixels import Lanes, numbered_rays
from tracer.ray import Ray
from tracer.replay import Program
from tracer.surface import Surface, surface_at
from tracer.suspects import find_suspects

MOST_LIGHTS = 4
"""Each takes 8 bytes a primary ray while it is asked, and 4 from then on."""


@dataclass(frozen=True)
class Question:
    """From which of the points that the primary rays of a launch meet first is a light hidden? `slots` (lanes
    n n,): of the triangles that they meet; `sample`: the light's only one."""

    scene: DeviceScene
    canvas: DeviceCanvas
    lanes: Lanes
    slots: Any
    sample: LightSample


def lights_asked(scene: DeviceScene) -> list[UnrolledLight]:
    """The lights whose shadows are found in bundles: the first ones of those with one sample."""
    if scene.triangles is None or scene.lights.unrolled is None or scene.options.transparent_shadows:
        return []
    return [light for light in scene.lights.unrolled if len(light.samples) == 1][:MOST_LIGHTS]


def first_shadows(
    scene: DeviceScene, canvas: DeviceCanvas, lanes: Lanes, slots: Any, every_kernel: bool = False
) -> list[Any]:
    """For each of `lights_asked` and every primary ray of a launch (lanes n n,), `HIDDEN` where triangles
    hide the light from the point that it meets first. `slots`: of the triangles that they meet;
    `every_kernel`: see `answers_to`."""
    lights = lights_asked(scene)
    if not lights:
        return []
    points = lit_points(scene, canvas, lanes, slots)

    def hidden_from(sample: LightSample, where: list[Any]) -> Any:
        question = Question(scene, canvas, lanes, slots, sample)
        return answers_to(
            scene.backend.UInt32,
            len(slots),
            lambda numbers, both: Found(**bundled(scene, sample.position, where, numbers, both)),
            lambda found, places, numbers: among(question, found, places, numbers)["hidden"],
            lambda numbers: singly(question, numbers)["hidden"],
            every_kernel,
        )

    return [
        hidden_from(
            light.samples[0], [points[name] for name in ("x", "y", "z", "primitive", _reach_of(number))]
        )
        for number, light in enumerate(lights)
    ]


@Program
def lit_points(scene: DeviceScene, canvas: DeviceCanvas, lanes: Lanes, slots: Any) -> dict[str, Any]:
    """What all rays of a launch meet: the point `x`, `y`, `z` and its `primitive`, and for each light how far
    it reaches (see `LitPoints`)."""
    assert scene.triangles is not None
    backend = scene.backend
    number = dr.arange(backend.UInt32, len(slots))
    ray, surface, found = _first_surface(scene, canvas, lanes, number, slots)
    values = {"x": surface.p.x, "y": surface.p.y, "z": surface.p.z, "primitive": surface.primitive}
    for k, light in enumerate(lights_asked(scene)):
        faces = found & may_be_lit(backend, surface, light.ball)
        suspects = find_suspects(scene, surface, light.ball, faces, spheres=False, beams=False)
        segment = segment_to(ray, surface, light.samples[0])
        asks = suspects.meshes & ~hidden_by_plane(scene, segment, faces) & (segment.length > 0)
        reach = certain_reach(backend, scene.triangles, surface.p, surface.lit_side, segment.light)
        values[_reach_of(k)] = dr.select(asks, reach, 0)
    return values


@Program
def bundled(scene: DeviceScene, light: Any, where: list[Any], numbers: Any, both: bool) -> dict[str, Any]:
    """Whether triangles hide a light (3, 1) from the points of bundles with these numbers, as in `Found`."""
    assert scene.triangles is not None
    backend = scene.backend
    *place, primitives, reach = where
    bundles = LitPoints(
        reach=neighbors(backend, reach, numbers),
        points=lambda: neighboring_points(backend, place, numbers),
        primitives=lambda: neighbors(backend, primitives, numbers),
    )
    return vars(hidden_points(backend, scene.triangles, light, bundles, both))


@Program
def among(question: Question, found: Found, places: Any, numbers: Any) -> dict[str, Any]:
    """The answers to the rays with these numbers by the candidates in these places of what bundles found, and
    `DOUBTFUL` where they do not tell."""
    asked = dr.gather(type(places), found.answers, places) != DOUBTFUL
    blocked = _blocked(question, numbers, asked, partial(found.fold, places))
    hidden = dr.select(blocked, question.scene.backend.UInt32(HIDDEN), LIT)
    return {"hidden": dr.select(asked, hidden, DOUBTFUL)}


@Program
def singly(question: Question, numbers: Any) -> dict[str, Any]:
    """The same for the rays with these numbers, each by itself."""
    backend = question.scene.backend
    blocked = _blocked(question, numbers, dr.full(backend.Bool, True, len(numbers)))
    return {"hidden": dr.select(blocked, backend.UInt32(HIDDEN), LIT)}


def _blocked(question: Question, numbers: Any, active: Any, candidates: Fold | None = None) -> Any:
    """Mask: a triangle, of all or of some candidates, hides the light from what rays meet first."""
    scene = question.scene
    known = dr.gather(scene.backend.UInt32, question.slots, numbers)
    ray, surface, found = _first_surface(scene, question.canvas, question.lanes, numbers, known)
    blocked = dr.full(scene.backend.Bool, False, len(numbers))
    segment = segment_to(ray, surface, question.sample)
    return hidden_by_triangle(scene, segment, surface, blocked, active & found, candidates)


def _first_surface(
    scene: DeviceScene, canvas: DeviceCanvas, lanes: Lanes, number: Any, slot: Any
) -> tuple[Ray, Surface, Any]:
    """Rays by number, what they meet first, and mask: they meet something."""
    pixels, o, d = numbered_rays(scene.backend, canvas, lanes, number)
    ray = free_ray(scene, o, d)
    everything = dr.full(scene.backend.Bool, True, dr.width(number))
    hit = closest_hit(scene, ray, pixels.active, known=Known(everything, slot))
    return ray, surface_at(scene, ray, hit, pixels.active), pixels.active & hit.valid


def _reach_of(light: int) -> str:
    return f"reach of light {light}"
