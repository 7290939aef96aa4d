"""The term of direct light: what the renderer's own shadows let through, light by light.

A render does not ask `tracer.visible`: it asks for a whole light at once, and only the samples in doubt one
by one (docs/numerics.md). So that code runs here, on hit points with a white matte finish, and its sum is
compared with the same sum over Mitsuba's answers for every single sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import numpy as np

import tracer
from reference.comparison.case import Case, sizes
from reference.comparison.decisions import Decisions, judge_decisions
from reference.comparison.judge import SINGLE, Sides
from reference.comparison.placements import still_lights
from reference.comparison.rays import RaySet
from reference.comparison.records import Outcome, Term
from reference.comparison.truth import Truth
from reference.comparison.visibility import FARTHEST, border_distance, exact_visibility, has_lights
from reference.mitsuba_scene import SHADOW_START
from reference.tolerances import TOLERANCES
from tracer.arrival import Finish
from tracer.backends import exact_arithmetic, find_backend
from tracer.device_scene import compile_scene
from tracer.direct_light import direct_light
from tracer.intersection import closest_hit, free_ray
from tracer.queries import END_GUARD
from tracer.surface import surface_at

Array = np.ndarray

PAIRS = 150_000
"""Pairs of a point and a light sample, at most."""


@dataclass(frozen=True)
class Lit:
    """n points that our renderer lit: `rays` that reached them, `p`, shading `normal` and `lit_side` (n, 3),
    and `light` (n,): D, the sum of w V (n.l) over all samples."""

    rays: RaySet
    p: Array
    normal: Array
    lit_side: Array
    light: Array

    def part(self, k: Array) -> Lit:
        """Some of the points, by number or mask."""
        return Lit(self.rays.part(k), self.p[k], self.normal[k], self.lit_side[k], self.light[k])


@dataclass(frozen=True)
class Ways:
    """From n points to all m samples: `cosine` w (n.l) (n, m), 0 where the sample lies on the dark side or
    rounding decides on which; ends `p`, `light` (n m, 3)."""

    cosine: Array
    p: Array
    light: Array

    def light_of(self, seen: Array) -> Array:
        """(n,) the sum over the samples that are seen (n m,)."""
        return np.asarray((self.cosine * seen.reshape(self.cosine.shape)).sum(axis=1))


def matte(scene: tracer.Scene) -> tracer.Scene:
    """The scene under white light without jitter, opaque."""
    lights = [light.model_copy(update={"color": (1.0, 1.0, 1.0)}) for light in still_lights(scene)]
    update = {"lights": lights, "transparent_shadows": False, "diffuse_term": "lambert"}
    return scene.model_copy(update=update)


def lit_points(case: Case, scene: tracer.Scene, most: int) -> Lit:
    """Where up to so many rays end, lit by the renderer's code."""
    rays = case.bench.rays.part(np.linspace(0, len(case.bench.rays) - 1, most).astype(int))
    types = find_backend(case.backend, case.precision)
    with exact_arithmetic():
        device = compile_scene(scene, types)
        o, d = (
            types.Vector3(*(types.Float(np.ascontiguousarray(c, types.dtype)) for c in v.T))
            for v in (rays.o, rays.d)
        )
        ray, everything = free_ray(device, o, d), dr.full(types.Bool, True, most)
        hit = closest_hit(device, ray, everything)
        surface = surface_at(device, ray, hit, everything)
        none, one = dr.zeros(types.Float, most), dr.full(types.Float, 1, most)
        number = dr.zeros(types.UInt32, most)
        light = direct_light(device, ray, surface, Finish(one, none, one), number, number, hit.valid).total
        dr.eval(hit, surface, light)
    p, normal, lit_side = (
        v.numpy().T.astype(np.float64) for v in (surface.p, surface.normal, surface.lit_side)
    )
    found = Lit(rays, p, normal, lit_side, light.x.numpy().astype(np.float64))
    near = np.abs(p).max(axis=1) <= FARTHEST * case.bench.mitsuba.extent
    return found.part(np.flatnonzero(hit.valid.numpy() & near))


def ways_to_lights(scene: tracer.Scene, truth: Truth, points: Lit) -> Ways:
    """All ways from the points to the samples, with what each would bring."""
    counts = np.diff(truth.first_light)
    weight = np.array([light.weight for light in scene.lights])
    share = np.repeat(weight / weight.sum() / counts, counts)
    n, m = len(points.p), len(truth.lights)
    p, light = np.repeat(points.p, m, axis=0), np.tile(truth.lights, (n, 1))
    length = np.linalg.norm(light - p, axis=1)
    way = ((light - p) / np.maximum(length, 1e-300)[:, None]).reshape(n, m, 3)
    cosine = (way * points.normal[:, None]).sum(axis=2)
    faces = (cosine > 0) & ((way * points.lit_side[:, None]).sum(axis=2) > 0)
    return Ways(np.where(faces, share * cosine, 0), p, light)


def compare_direct_light(case: Case) -> Outcome:
    """D at hit points: the renderer's, against the sum over Mitsuba's answers for every sample."""
    scene = matte(case.bench.scene)
    truth = Truth.of(scene)
    most = max(1, min(len(case.bench.rays), PAIRS // max(1, len(truth.lights))))
    points = lit_points(case, scene, most)
    ways = ways_to_lights(scene, truth, points)
    theirs = ways.light_of(case.bench.mitsuba.visible(ways.p, ways.light))
    extent = sizes(truth, points.p, points.p)
    closest = (
        np.linalg.norm(ways.light - ways.p, axis=1).reshape(ways.cosine.shape).min(axis=1, initial=np.inf)
    )
    allowed = TOLERANCES["direct light"].value * case.epsilon * (1 + extent / np.maximum(closest, 1e-300))
    farthest = max([case.bench.mitsuba.extent, *(np.abs(x).max(initial=0) for x in (ways.p, ways.light))])
    guard, own_guard = SHADOW_START * farthest, END_GUARD[case.precision] * farthest

    def samples_of(k: Array) -> tuple[Ways, Array]:
        some = ways_to_lights(scene, truth, points.part(k))
        return some, np.repeat(extent[k], len(truth.lights))

    def in_band(k: Array) -> Array:
        """The samples in doubt could make the difference."""
        some, size = samples_of(k)
        band = TOLERANCES["grazing band"].value * SINGLE * size
        doubtful = border_distance(truth, some.p, some.light, guard) <= band
        return some.light_of(doubtful) + allowed[k] >= np.abs(points.light - theirs)[k]

    def exact(k: Array, width: float) -> Array:
        some, _ = samples_of(k)
        return some.light_of(exact_visibility(truth, some.p, some.light, width))

    def wrong(k: Array) -> tuple[Array, Array]:
        off = (np.abs(side[k] - exact(k, w)) for side, w in ((points.light, own_guard), (theirs, guard)))
        own, other = (error > allowed[k] for error in off)
        return own, other

    def answers(k: int) -> Sides:
        values = (points.light[k], theirs[k], exact(np.array([k]), own_guard)[0])
        return tuple(f"D = {value:.9g} at {points.p[k].tolist()}" for value in values)  # type: ignore[return-value]

    differ = np.abs(points.light - theirs) > allowed
    return judge_decisions(
        case, "direct light", Decisions(points.rays, differ, in_band, wrong, answers), "lit points"
    )


def terms() -> list[Term]:
    """The one term."""
    compares = "the light that the renderer's shadows let through"
    return [Term("direct light", compares, has_lights, compare_direct_light)]
