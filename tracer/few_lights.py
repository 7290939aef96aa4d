"""Direct light of few lights: all samples stand in the kernel one by one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import drjit as dr

from tracer.arrival import DirectLight, Finish, Watch, arrive, segment_to
from tracer.backends import Backend
from tracer.device_scene import DeviceScene
from tracer.light_tables import LightSample, UnrolledLight, fetch_position
from tracer.occlusion import hidden_by_many, hidden_by_plane, hidden_by_sphere
from tracer.ray import Ray, max_abs
from tracer.shafts import Ball
from tracer.surface import Surface
from tracer.suspects import find_suspects


@dataclass
class Shadows:
    """What is known of triangles between lights of one sample and hits, for the first few of such lights:
    masks, whether it is `known` (n,) of a hit, and that one is `hidden` (n,)."""

    known: list[Any]
    hidden: list[Any]


def light_of_few(
    scene: DeviceScene,
    ray: Ray,
    surface: Surface,
    finish: Finish,
    lights: list[UnrolledLight],
    active: Any,
    watch: Watch,
    shadows: Shadows | None,
) -> DirectLight:
    """What arrives from lights at hits; `shadows`: what is known of them already."""
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
    found = [] if shadows is None else list(zip(shadows.known, shadows.hidden, strict=True))
    for light, faces, is_area in zip(lights, facing, areas, strict=True):
        who = find_suspects(scene, surface, light.ball, faces, spheres=any(areas), beams=is_area)
        if found and not is_area:
            known, is_hidden = found.pop(0)
            who.meshes &= ~known
            who.umbra |= known & is_hidden
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
