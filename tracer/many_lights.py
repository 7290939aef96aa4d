"""Direct light of many or jittered lights: a loop over a table of samples.

With `transparent_shadows` few lights go this way too.
"""

from __future__ import annotations

from typing import Any

import drjit as dr

from tracer.arrival import DirectLight, Finish, Watch, arrive
from tracer.backends import INVALID
from tracer.device_scene import DeviceScene
from tracer.light_tables import fetch_ball, fetch_sample, jitter_shift
from tracer.occlusion import hidden, transmittance
from tracer.ray import Ray, max_abs
from tracer.shafts import Suspects
from tracer.shapes.plane import PlaneSlot
from tracer.surface import Surface
from tracer.suspects import find_suspects


def light_of_many(
    scene: DeviceScene,
    ray: Ray,
    surface: Surface,
    finish: Finish,
    pixel: Any,
    sub_ray: Any,
    active: Any,
    watch: Watch,
) -> DirectLight:
    """What arrives from all lights at hits."""
    backend, lights = scene.backend, scene.lights
    width = dr.width(active)
    spheres = lights.areas or scene.options.transparent_shadows

    def body(
        i: Any, light: Any, who: Suspects, shift: Any, received: DirectLight, seen: list[Any]
    ) -> tuple[Any, ...]:
        number = dr.gather(backend.UInt32, lights.lights, i)

        def next_light(who: Suspects, shift: Any) -> tuple[Suspects, Any]:
            if lights.jitter:
                shift = jitter_shift(backend, lights, number, pixel, sub_ray)
            ball = fetch_ball(backend, lights, number)
            return find_suspects(scene, surface, ball, active, spheres=spheres, beams=lights.areas), shift

        who, shift = dr.if_stmt(
            args=(who, shift),
            cond=number != light,
            true_fn=next_light,
            false_fn=lambda who, shift: (who, shift),
            label="next light",
        )
        sample, color, part = fetch_sample(backend, lights, i, shift, lambda p: plane_bits_of(scene, p))
        arrival = arrive(scene, ray, surface, finish, sample)
        lit = active & arrival.lit
        if scene.options.transparent_shadows:
            share = transmittance(scene, arrival.segment, surface, who, lit)
        else:
            share = dr.select(hidden(scene, arrival.segment, surface, who, lit), backend.Float(0), 1)
        Watch(False, seen, watch.lanes).add(number, share * part, lit)
        specular = [
            before + dr.select(lit, share * arrival.specular * color, 0) for before in received.specular
        ]
        total = received.total + dr.select(lit, share * arrival.local * color, 0)
        shadow_rays = received.shadow_rays + dr.select(lit, backend.UInt32(1), 0)
        return i + 1, number, who, shift, DirectLight(total, shadow_rays, specular), seen

    start = (
        dr.select(active, dr.zeros(backend.UInt32, width), lights.count),
        dr.full(backend.UInt32, INVALID, width),
        Suspects.nobody(backend, width, spheres),
        dr.zeros(backend.Vector2, width),
        DirectLight.none(backend, width, watch),
        watch.seen,
    )
    *_, received, _ = dr.while_loop(
        state=start, cond=lambda i, *_: i < lights.count, body=body, label="lights"
    )
    return received


def plane_bits_of(scene: DeviceScene, p: Any) -> tuple[Any, Any]:
    """A light's bits for the planes, and which of them count: a light on a plane is not hidden by it."""
    backend = scene.backend
    sides, decided = backend.UInt32(0), backend.UInt32(0)
    for slot in scene.slots:
        if isinstance(slot, PlaneSlot) and slot.bit is not None:
            distance = dr.dot(slot.n, p) + slot.d
            bound = 8 * backend.epsilon * dr.maximum(max_abs(p), dr.abs(slot.d))
            bit = backend.UInt32(1 << slot.bit)
            sides = sides | dr.select(distance > 0, bit, 0)
            decided = decided | dr.select(dr.abs(distance) > bound, bit, 0)
    return sides, decided
