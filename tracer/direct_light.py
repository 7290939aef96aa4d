"""The light that reaches a surface straight from the lights (document, sections 2 and 4): D and H."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.device_scene import DeviceScene
from tracer.intersection import Surface, hidden, leave, transmittance
from tracer.light_samples import LightSample, fetch_light
from tracer.ray import Ray, Segment, max_abs
from tracer.shapes.plane import PlaneSlot


@dataclass
class Finish:
    """The local part of a material at n hits: factors `diffuse` m and `specular` h, exponent `shininess`
    s."""

    diffuse: Any
    specular: Any
    shininess: Any


@dataclass
class SampleTerms:
    """One light's share at n hits: m D + h H with its color (3, n), and whether a shadow ray was traced."""

    light: Any
    shadow_ray: Any


@dr.syntax
def direct_light(
    scene: DeviceScene, ray: Ray, surface: Surface, finish: Finish, pixel: Any, sub_ray: Any, active: Any
) -> tuple[Any, Any]:
    """m D + h H (3, n) over all light samples, and the number of shadow rays (n,)."""
    backend = scene.backend
    width = dr.width(active)
    total = dr.zeros(backend.Vector3, width)
    shadow_rays = dr.zeros(backend.UInt32, width)
    few = scene.lights.samples
    if dr.hint(few is not None, mode="scalar"):
        for sample in few or []:
            terms = sample_terms(scene, ray, surface, finish, sample, active)
            total += terms.light
            shadow_rays += dr.select(terms.shadow_ray, backend.UInt32(1), 0)
        return total, shadow_rays
    i = dr.select(active, dr.zeros(backend.UInt32, width), scene.lights.count)
    while dr.hint(
        i < scene.lights.count, label="lights", exclude=[scene, backend, ray, surface, finish, pixel, sub_ray]
    ):
        sample = fetch_light(backend, scene.lights, i, pixel, sub_ray, lambda p: _sides_and_decided(scene, p))
        terms = sample_terms(scene, ray, surface, finish, sample, active)
        total += terms.light
        shadow_rays += dr.select(terms.shadow_ray, backend.UInt32(1), 0)
        i += 1
    return total, shadow_rays


def sample_terms(
    scene: DeviceScene, ray: Ray, surface: Surface, finish: Finish, sample: LightSample, active: Any
) -> SampleTerms:
    """What one point light adds to m D + h H, its shadow included.

    l = (L - p)/|L - p|, r = 2(n.l)n - l, v = -d; both terms are 0 unless n.l > 0 (for a smooth mesh: by its
    geometric normal too) and where the light lies on the shaded point.
    """
    backend = scene.backend
    to_light = sample.position - surface.p
    length = dr.sqrt(dr.squared_norm(to_light))
    l = to_light * dr.rcp(length)  # noqa: E741 - the document's letter
    cosine = dr.dot(surface.normal, l)
    lit = active & (cosine > 0) & (length > 0)
    if scene.smooth is not None:
        lit = lit & (dr.dot(surface.lit_side, l) > 0)
    mirrored = 2 * cosine * -dr.dot(surface.normal, ray.d) + dr.dot(l, ray.d)
    mirrored = dr.select(mirrored > 0, mirrored, 0)
    matters = lit & (finish.specular > 0) & ((mirrored > 0) | (finish.shininess == 0))
    highlight = _power(mirrored, finish.shininess, matters)
    diffuse = cosine if scene.options.diffuse_is_lambert else mirrored
    local = dr.fma(finish.diffuse, diffuse, finish.specular * highlight)
    segment = Segment(
        leave(ray, surface, l, crosses=False), length, sample.position, sample.sides, sample.decided
    )
    if scene.options.transparent_shadows:
        local = local * transmittance(scene, segment, lit)
        visible = lit
    else:
        visible = lit & ~hidden(scene, segment, lit)
    return SampleTerms(dr.select(visible, local * sample.color, backend.Vector3(0)), lit)


@dr.syntax
def _power(base: Any, exponent: Any, active: Any) -> Any:
    """base^exponent with 0^0 = 1; a branch, since most packets of lanes have no highlight to raise."""
    result = dr.zeros(type(base), dr.width(active))
    if active:
        result = dr.select(exponent == 0, 1, dr.power(base, exponent))
    return result


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
