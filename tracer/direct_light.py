"""The light that reaches a surface straight from the lights (document, sections 2 and 4): D and H."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import drjit as dr

from tracer.arrival import NOTHING_WATCHED, DirectLight, Finish, Watch, arrive, segment_to
from tracer.backends import INVALID, Backend
from tracer.device_scene import DeviceScene
from tracer.intersection import Surface
from tracer.light_tables import (
    LightSample,
    UnrolledLight,
    fetch_ball,
    fetch_position,
    fetch_sample,
    jitter_shift,
)
from tracer.occlusion import (
    hidden,
    hidden_by_many,
    hidden_by_plane,
    hidden_by_sphere,
    transmittance,
)
from tracer.ray import Ray, max_abs
from tracer.shafts import Ball, Suspects
from tracer.shapes.plane import PlaneSlot
from tracer.suspects import find_suspects


@dataclass
class Shadows:
    """What is known of triangles between lights of one sample and hits: mask `known` (n,) of those hits, and
    for the first few of such lights whether one is `hidden` (n,)."""

    known: Any
    hidden: list[Any]


def direct_light(
    scene: DeviceScene,
    ray: Ray,
    surface: Surface,
    finish: Finish,
    pixel: Any,
    sub_ray: Any,
    active: Any,
    watch: Watch = NOTHING_WATCHED,
    shadows: Shadows | None = None,
) -> DirectLight:
    """The light of all samples that arrives at hits; `shadows`: what is known of them already."""
    if scene.lights.unrolled is None or scene.options.transparent_shadows:
        return _looped(scene, ray, surface, finish, pixel, sub_ray, active, watch)
    return _unrolled(scene, ray, surface, finish, scene.lights.unrolled, active, watch, shadows)


# ---- Few lights: all samples stand in the kernel -----------------------------------------------------------


def _unrolled(
    scene: DeviceScene,
    ray: Ray,
    surface: Surface,
    finish: Finish,
    lights: list[UnrolledLight],
    active: Any,
    watch: Watch,
    shadows: Shadows | None,
) -> DirectLight:
    backend = scene.backend
    width = dr.width(active)
    facing = [active & may_be_lit(backend, surface, light.ball) for light in lights]
    dark = _dark_samples(scene, ray, surface, lights, facing, shadows)

    def shade(
        received: DirectLight, seen: list[Any], light: UnrolledLight, faces: Any
    ) -> tuple[DirectLight, list[Any]]:
        share, shadow_rays = dr.zeros(backend.Float, width), received.shadow_rays
        highlight, arrived = dr.zeros(backend.Float, width), dr.zeros(backend.UInt32, width)
        for number, sample in enumerate(light.samples, light.first):
            arrival = arrive(scene, ray, surface, finish, sample)
            lit = arrival.lit & faces
            blocked = hidden_by_plane(scene, arrival.segment, lit) | ((dark >> number) & 1 != 0)
            if len(light.samples) == 1:
                blocked = blocked | hidden_by_sphere(scene, arrival.segment, lit)
            arrives = lit & ~blocked
            share = share + dr.select(arrives, arrival.local, 0)
            highlight = highlight + dr.select(arrives, arrival.specular, 0)
            arrived = arrived + dr.select(arrives, backend.UInt32(1), 0)
            shadow_rays = shadow_rays + dr.select(lit, backend.UInt32(1), 0)
        part = backend.Float(arrived) / len(light.samples)
        Watch(False, seen, watch.lanes).add(backend.UInt32(light.number), part, True)
        specular = [dr.fma(highlight, light.color, before) for before in received.specular]
        return DirectLight(dr.fma(share, light.color, received.total), shadow_rays, specular), seen

    received = DirectLight.none(backend, width, watch)
    for light, faces in zip(lights, facing, strict=True):
        received, _ = dr.if_stmt(
            args=(received, watch.seen),
            cond=faces,
            true_fn=partial(shade, light=light, faces=faces),
            false_fn=lambda received, seen: (received, seen),
            label="light",
        )
    return received


def may_be_lit(backend: Backend, surface: Surface, ball: Ball) -> Any:
    """Mask: some point of the ball may lie on the lit side."""
    axis = ball.center - surface.p
    return dr.dot(surface.normal, axis) + ball.radius + 16 * backend.epsilon * max_abs(axis) > 0


def _dark_samples(
    scene: DeviceScene,
    ray: Ray,
    surface: Surface,
    lights: list[UnrolledLight],
    facing: list[Any],
    shadows: Shadows | None,
) -> Any:
    """One bit a sample (n,): hidden by a mesh, or, for samples of an area light, by a sphere.

    Most points see all of a light or have but one suspect: only samples that somebody may hide are tested.
    """
    backend = scene.backend
    width = dr.width(surface.p)
    dark = dr.zeros(backend.UInt32, width)
    areas = [len(light.samples) > 1 for light in lights]
    crowded = scene.triangles is not None or scene.sphere_table is not None
    if not lights or not (crowded or any(areas)):
        return dark
    suspects, todo = [], dr.zeros(backend.UInt32, width)
    known = [] if shadows is None else list(shadows.hidden)
    for light, faces, is_area in zip(lights, facing, areas, strict=True):
        who = find_suspects(scene, surface, light.ball, faces, spheres=any(areas), beams=is_area)
        if shadows is not None and known and not is_area:
            who.meshes &= ~shadows.known
            who.umbra |= shadows.known & known.pop(0)
        bits = ((1 << len(light.samples)) - 1) << light.first
        # Of spheres by themselves only area lights are asked here.
        asked = who.doubtful & (is_area | who.meshes | who.many)
        todo |= dr.select(faces & asked, backend.UInt32(bits), 0)
        dark |= dr.select(who.umbra, backend.UInt32(bits), 0)
        suspects.append(who)

    def body(todo: Any, dark: Any) -> tuple[Any, Any]:
        number = dr.tzcnt(todo)
        position = fetch_position(backend, scene.lights, number)
        segment = segment_to(ray, surface, LightSample(position, backend.UInt32(0), backend.UInt32(0)))
        who = suspects[0]
        for light, other in zip(lights[1:], suspects[1:], strict=True):
            who = dr.select(number >= light.first, other, who)
        # The cheap ones first: a light is often hidden by the sphere that its point lies in.
        everybody = dr.full(backend.Bool, True, width)
        blocked = hidden_by_sphere(scene, segment, everybody, who.spheres)
        blocked = blocked | hidden_by_many(scene, segment, surface, who, ~blocked)
        return todo & (todo - 1), dark | dr.select(blocked, backend.UInt32(1) << number, 0)

    _, dark = dr.while_loop(state=(todo, dark), cond=lambda todo, dark: todo != 0, body=body, label="shadows")
    return dark


# ---- Many or jittered lights: a table ----------------------------------------------------------------------


def _looped(
    scene: DeviceScene,
    ray: Ray,
    surface: Surface,
    finish: Finish,
    pixel: Any,
    sub_ray: Any,
    active: Any,
    watch: Watch,
) -> DirectLight:
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
