"""The term of visibility: which lights are seen from the points that are hit."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import tracer
from reference import extended
from reference.comparison import grazing
from reference.comparison.case import Case, sizes
from reference.comparison.decisions import Decisions, judge_decisions
from reference.comparison.judge import SINGLE, Sides
from reference.comparison.rays import RaySet, single
from reference.comparison.records import Outcome, Term
from reference.comparison.truth import Truth
from reference.mitsuba_scene import SHADOW_START
from reference.tolerances import TOLERANCES
from tracer.queries import END_GUARD

Array = np.ndarray

FARTHEST = TOLERANCES["far points"].value
"""Points are at most so many extents S from the origin along an axis."""


@dataclass(frozen=True)
class WayRays(RaySet):
    """Ways from points to lights: `first`, the rays that reached the points; a replay shows those, and which
    lights are seen from where they end."""

    first: RaySet

    def options(self, k: int) -> str:
        """The options that show the point again."""
        return self.first.options(k)


def has_lights(scene: tracer.Scene) -> bool:
    """Whether there is something to see and something to see it by."""
    return bool(scene.shapes and scene.lights)


def ways(case: Case) -> tuple[WayRays, Array, int]:
    """From each of our hit points to every light, one of its samples (n, 3): the ways as rays of unit
    direction; and how many are left out, since a point is far away, where both sides scale their guards by
    it, or too close to the light."""
    rays, ours, truth = case.bench.rays, case.ours, case.bench.truth
    rng = np.random.default_rng([case.seed, 2])
    near = np.abs(np.nan_to_num(ours.position)).max(axis=1) <= FARTHEST * case.bench.mitsuba.extent
    k = np.flatnonzero(ours.valid & near)
    counts = np.diff(truth.first_light)
    k, number = np.tile(k, len(counts)), np.repeat(np.arange(len(counts)), len(k))
    sample = truth.first_light[number] + rng.integers(counts[number])
    p, light = ours.position[k].astype(np.float64), single(truth.lights)[sample]
    length = np.linalg.norm(light - p, axis=1)
    apart = np.flatnonzero(length > 10 * SHADOW_START * FARTHEST * case.bench.mitsuba.extent)
    k, p, light, d = k[apart], p[apart], light[apart], ((light - p) / length[:, None])[apart]
    left_out = int(ours.valid.sum()) * len(counts) - len(k)
    return WayRays(p, d, rays.pixel[k], rays.part(k)), light, left_out


def compare_visibility(case: Case) -> Outcome:
    """Whether a light is seen. Each side leaves out what is next to the ends, Mitsuba's guard being the
    wider: blockers there, and ways that run within the band of a silhouette, an edge or, past the guard, of a
    surface, may be counted otherwise."""
    truth, scene = case.bench.truth, case.bench.scene
    rays, light, left_out = ways(case)
    ours = tracer.visible(scene, rays.o, light, precision=case.precision, backend=case.backend)
    theirs = case.bench.mitsuba.visible(rays.o, light)
    farthest = max([case.bench.mitsuba.extent, *(np.abs(x).max(initial=0) for x in (rays.o, light))])
    guard, own_guard = SHADOW_START * farthest, END_GUARD[case.precision] * farthest

    def in_band(k: Array) -> Array:
        band = TOLERANCES["grazing band"].value * SINGLE * sizes(truth, rays.o[k], light[k])
        return border_distance(truth, rays.o[k], light[k], guard) <= band

    def wrong(k: Array) -> tuple[Array, Array]:
        seen = (exact_visibility(truth, rays.o[k], light[k], width) for width in (own_guard, guard))
        own, other = seen
        return ours[k] != own, theirs[k] != other

    def answers(k: int) -> Sides:
        one = slice(k, k + 1)
        (exact,) = exact_visibility(truth, rays.o[one], light[one], END_GUARD["double"] * farthest)
        where = f"the light at {light[k].tolist()}"
        said = ("sees" if seen else "does not see" for seen in (ours[k], theirs[k], exact))
        return tuple(f"{verb} {where}" for verb in said)  # type: ignore[return-value]

    outcome = judge_decisions(case, "visibility", Decisions(rays, ours != theirs, in_band, wrong, answers))
    return replace(outcome, figures={"ways left out": float(left_out)})


def border_distance(truth: Truth, p: Array, light: Array, guard: float) -> Array:
    """(n,) how far ways are from the border of a shadow: from silhouettes and edges between the ends, and at
    both ends, a guard inside, from any surface; 0 where a surface is crossed nowhere but in the guards."""
    if not len(p):
        return np.zeros(0)
    length = np.linalg.norm(light - p, axis=1)
    d = (light - p) / length[:, None]
    distance = grazing.silhouette_distance(truth, p, d, length)
    for end in (p + guard * d, light - guard * d):
        distance = np.minimum(distance, grazing.start_distance(truth, end))
    only_in_guards = exact_visibility(truth, p, light, guard) & ~exact_visibility(
        truth, p, light, guard * END_GUARD["double"] / SHADOW_START
    )
    return np.where(only_in_guards, 0, distance)


def exact_visibility(truth: Truth, p: Array, light: Array, guard: float) -> Array:
    """(n,) whether nothing lies between two points, a guard left out at either end."""
    if not len(p):
        return np.zeros(0, bool)
    length = np.linalg.norm(light - p, axis=1)
    d = (light - p) / length[:, None]
    crossings = truth.crossings(extended.number(p) + extended.number(guard) * d, extended.unit(d))
    t = np.stack([t for t, _, _ in crossings], axis=1)
    return np.asarray(~((t > 0) & (t < (length - 2 * guard)[:, None])).any(axis=1))


def terms() -> list[Term]:
    """The one term."""
    return [Term("visibility", "which lights are seen from the points hit", has_lights, compare_visibility)]
