"""The light that reaches a surface straight from the lights (document, sections 2 and 4): D and H."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import drjit as dr

from tracer.backends import INVALID, Backend
from tracer.device_scene import DeviceScene
from tracer.intersection import Surface, leave
from tracer.light_tables import (
    LightSample,
    UnrolledLight,
    fetch_ball,
    fetch_position,
    fetch_sample,
    jitter_shift,
)
from tracer.occlusion import (
    find_suspects,
    hidden,
    hidden_by_many,
    hidden_by_plane,
    hidden_by_sphere,
    transmittance,
)
from tracer.ray import Ray, Segment, max_abs
from tracer.shafts import Ball, Suspects
from tracer.shapes.plane import PlaneSlot

VANISHING = -1000
"""Highlights of 2^-1000 and less are none."""


@dataclass
class Finish:
    """The local part of a material at n hits: factors `diffuse` m and `specular` h, exponent `shininess`
    s."""

    diffuse: Any
    specular: Any
    shininess: Any


@dataclass
class Arrival:
    """What one point light would add at n hits: `local` m D + h H before color and shadow, mask `lit` where
    the surface faces it, and the `segment` to the light."""

    local: Any
    lit: Any
    segment: Segment


def direct_light(
    scene: DeviceScene, ray: Ray, surface: Surface, finish: Finish, pixel: Any, sub_ray: Any, active: Any
) -> tuple[Any, Any]:
    """m D + h H (3, n) over all light samples, and the number of shadow rays (n,): of samples whose light
    is asked for, also where the answer for a whole light is known at once."""
    if scene.lights.unrolled is None or scene.options.transparent_shadows:
        return _looped(scene, ray, surface, finish, pixel, sub_ray, active)
    return _unrolled(scene, ray, surface, finish, scene.lights.unrolled, active)


@dr.syntax
def _power(base: Any, exponent: Any, active: Any) -> Any:
    """base^exponent with 0^0 = 1; a branch, since most packets of lanes have no highlight to raise."""
    result = dr.zeros(type(base), dr.width(active))
    if active:
        binary = exponent * dr.log2(base)
        # Dr.Jit's exponential gives -inf, not 0, where the result leaves the range of double precision.
        power = dr.select(binary > VANISHING, dr.exp2(binary), 0)
        result = dr.select(exponent == 0, 1, power)
    return result


def arrive(scene: DeviceScene, ray: Ray, surface: Surface, finish: Finish, sample: LightSample) -> Arrival:
    """What one point light would add to m D + h H.

    l = (L - p)/|L - p|, r = 2(n.l)n - l, v = -d; both terms are 0 unless n.l > 0 (for a smooth mesh: by its
    geometric normal too) and where the light lies on the shaded point.
    """
    segment = segment_to(ray, surface, sample)
    l = segment.ray.d  # noqa: E741 - the document's letter
    cosine = dr.dot(surface.normal, l)
    lit = (cosine > 0) & (segment.length > 0)
    if scene.smooth is not None:
        lit = lit & (dr.dot(surface.lit_side, l) > 0)
    mirrored = dr.dot(surface.mirrored, l)
    mirrored = dr.select(mirrored > 0, mirrored, 0)
    matters = lit & (finish.specular > 0) & ((mirrored > 0) | (finish.shininess == 0))
    highlight = _power(mirrored, finish.shininess, matters)
    diffuse = cosine if scene.options.diffuse_is_lambert else mirrored
    return Arrival(dr.fma(finish.diffuse, diffuse, finish.specular * highlight), lit, segment)


def segment_to(ray: Ray, surface: Surface, sample: LightSample) -> Segment:
    """The straight way from the surface to a light."""
    to_light = sample.position - surface.p
    length = dr.sqrt(dr.squared_norm(to_light))
    way = leave(ray, surface, to_light * dr.rcp(length), crosses=False)
    return Segment(way, length, sample.position, sample.sides, sample.decided)


# ---- Few lights: all samples stand in the kernel -----------------------------------------------------------


def _unrolled(
    scene: DeviceScene,
    ray: Ray,
    surface: Surface,
    finish: Finish,
    lights: list[UnrolledLight],
    active: Any,
) -> tuple[Any, Any]:
    backend = scene.backend
    width = dr.width(active)
    total, shadow_rays = dr.zeros(backend.Vector3, width), dr.zeros(backend.UInt32, width)
    facing = [active & _may_be_lit(backend, surface, light.ball) for light in lights]
    dark = _dark_samples(scene, ray, surface, lights, facing)

    def shade(total: Any, shadow_rays: Any, light: UnrolledLight, faces: Any) -> tuple[Any, Any]:
        share = dr.zeros(backend.Float, width)
        for number, sample in enumerate(light.samples, light.first):
            arrival = arrive(scene, ray, surface, finish, sample)
            lit = arrival.lit & faces
            blocked = hidden_by_plane(scene, arrival.segment, lit) | ((dark >> number) & 1 != 0)
            if len(light.samples) == 1:
                blocked = blocked | hidden_by_sphere(scene, arrival.segment, lit)
            share = share + dr.select(lit & ~blocked, arrival.local, 0)
            shadow_rays = shadow_rays + dr.select(lit, backend.UInt32(1), 0)
        return dr.fma(share, light.color, total), shadow_rays

    for light, faces in zip(lights, facing, strict=True):
        total, shadow_rays = dr.if_stmt(
            args=(total, shadow_rays),
            cond=faces,
            true_fn=partial(shade, light=light, faces=faces),
            false_fn=lambda total, shadow_rays: (total, shadow_rays),
            label="light",
        )
    return total, shadow_rays


def _may_be_lit(backend: Backend, surface: Surface, ball: Ball) -> Any:
    """Mask: some point of the ball may lie on the lit side."""
    axis = ball.center - surface.p
    return dr.dot(surface.normal, axis) + ball.radius + 16 * backend.epsilon * max_abs(axis) > 0


def _dark_samples(
    scene: DeviceScene, ray: Ray, surface: Surface, lights: list[UnrolledLight], facing: list[Any]
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
    for light, faces, is_area in zip(lights, facing, areas, strict=True):
        who = find_suspects(scene, surface, light.ball, faces, spheres=is_area, beams=is_area)
        bits = ((1 << len(light.samples)) - 1) << light.first
        todo |= dr.select(faces & who.doubtful, backend.UInt32(bits), 0)
        dark |= dr.select(who.umbra, backend.UInt32(bits), 0)
        suspects.append(who)

    def body(todo: Any, dark: Any) -> tuple[Any, Any]:
        number = dr.tzcnt(todo)
        position = fetch_position(backend, scene.lights, number)
        segment = segment_to(ray, surface, LightSample(position, backend.UInt32(0), backend.UInt32(0)))
        who = suspects[0]
        for light, other in zip(lights[1:], suspects[1:], strict=True):
            who = dr.select(number >= light.first, other, who)
        blocked = dr.full(backend.Bool, False, width)
        if any(areas):
            blocked = hidden_by_sphere(scene, segment, ~blocked, who)
        blocked = blocked | hidden_by_many(scene, segment, surface, who, ~blocked)
        return todo & (todo - 1), dark | dr.select(blocked, backend.UInt32(1) << number, 0)

    _, dark = dr.while_loop(state=(todo, dark), cond=lambda todo, dark: todo != 0, body=body, label="shadows")
    return dark


# ---- Many or jittered lights: a table ----------------------------------------------------------------------


def _looped(
    scene: DeviceScene, ray: Ray, surface: Surface, finish: Finish, pixel: Any, sub_ray: Any, active: Any
) -> tuple[Any, Any]:
    backend, lights = scene.backend, scene.lights
    width = dr.width(active)

    def body(i: Any, light: Any, who: Suspects, shift: Any, total: Any, shadow_rays: Any) -> tuple[Any, ...]:
        number = dr.gather(backend.UInt32, lights.lights, i)

        def next_light(who: Suspects, shift: Any) -> tuple[Suspects, Any]:
            if lights.jitter:
                shift = jitter_shift(backend, lights, number, pixel, sub_ray)
            ball = fetch_ball(backend, lights, number)
            return find_suspects(scene, surface, ball, active, spheres=True, beams=lights.areas), shift

        who, shift = dr.if_stmt(
            args=(who, shift),
            cond=number != light,
            true_fn=next_light,
            false_fn=lambda who, shift: (who, shift),
            label="next light",
        )
        sample, color = fetch_sample(backend, lights, i, shift, lambda p: _sides_and_decided(scene, p))
        arrival = arrive(scene, ray, surface, finish, sample)
        lit = active & arrival.lit
        if scene.options.transparent_shadows:
            share = transmittance(scene, arrival.segment, surface, who, lit)
        else:
            share = dr.select(hidden(scene, arrival.segment, surface, who, lit), backend.Float(0), 1)
        total = total + dr.select(lit, share * arrival.local * color, 0)
        return i + 1, number, who, shift, total, shadow_rays + dr.select(lit, backend.UInt32(1), 0)

    start = (
        dr.select(active, dr.zeros(backend.UInt32, width), lights.count),
        dr.full(backend.UInt32, INVALID, width),
        Suspects.nobody(backend, width),
        dr.zeros(backend.Vector2, width),
        dr.zeros(backend.Vector3, width),
        dr.zeros(backend.UInt32, width),
    )
    *_, total, shadow_rays = dr.while_loop(
        state=start, cond=lambda i, *_: i < lights.count, body=body, label="lights"
    )
    return total, shadow_rays


def _sides_and_decided(scene: DeviceScene, p: Any) -> tuple[Any, Any]:
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
