"""Terms of primary hits: what is hit; by kind of shape distance, normal and position."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from reference.comparison.case import Case, once_a_case, roundness, truth_of_hits
from reference.comparison.decisions import Answers, free_questions, judge_ids
from reference.comparison.judge import SINGLE, Numbers, bounds, judge_numbers
from reference.comparison.kinds import by_kind, has_shapes
from reference.comparison.records import Outcome, Term
from reference.tolerances import TOLERANCES

Array = np.ndarray

AUDITED, AUDITED_PAIRS = 300, 400_000
"""Rays that extended precision traces through all primitives, and pairs of a ray and a triangle, at most."""


def compare_ids(case: Case) -> Outcome:
    """Hit mask, shape and primitive of every ray; of some, whether both sides are right where they agree."""
    rays, hits, other = case.bench.rays, case.ours, case.bench.theirs
    ours = Answers(hits.shape, hits.primitive, hits.t)
    theirs = Answers(other.shape, other.primitive, other.t)
    asked = free_questions(case, rays, ours, theirs, lambda true: audit(case, ours, true))
    return judge_ids(case, "hits", asked)


def audit(case: Case, ours: Answers, true: Callable[[Array], Answers]) -> Array:
    """(n,) mask: rays, of a sample of all, that hit something else than they should, whatever Mitsuba says:
    what both sides read from one place may be wrong on both."""
    most = min(AUDITED, AUDITED_PAIRS // max(1, len(case.bench.truth.corners)))
    k = np.random.default_rng([case.seed, 3]).permutation(len(ours.shape))[:most]
    wrong = np.zeros(len(ours.shape), bool)
    wrong[k] = ours.part(k).differ(true(k))
    return wrong


@dataclass(frozen=True)
class Agreed:
    """The rays of a case that hit the same primitive of one kind and do not graze it: their numbers `k`, the
    closed forms `t`, `normal`, |cosine| of arrival, S, `radius` and `condition` (see `roundness`), unit `d`;
    `left_out`: how many graze the rim of a sphere."""

    k: Array
    t: Array
    normal: Array
    cosine: Array
    extent: Array
    radius: Array
    condition: Array
    d: Array
    left_out: int


@once_a_case
def agreed(case: Case, kind: str) -> Agreed:
    """Where numbers can be compared; the rim of a sphere is left to the term of hits."""
    truth, rays, ours = case.bench.truth, case.bench.rays, case.ours
    k = np.flatnonzero(case.same & ours.valid)
    k = k[truth.kind[ours.shape[k]] == kind]
    t, normal = truth_of_hits(truth, rays.part(k), ours.shape[k], ours.primitive[k])
    d = rays.d[k] / np.linalg.norm(rays.d[k], axis=1, keepdims=True)
    cosine = np.abs((normal * d).sum(axis=1))
    radius, condition = roundness(truth, ours.shape[k], ours.primitive[k])
    extent = case.extents[k]
    clear = rim_clearance(radius, cosine) > TOLERANCES["grazing band"].value * SINGLE * extent
    k, t, normal, cosine, extent, radius, condition, d = (
        column[clear] for column in (k, t, normal, cosine, extent, radius, condition, d)
    )
    return Agreed(k, t, normal, cosine, extent, radius, condition, d, left_out=int((~clear).sum()))


def rim_clearance(radius: Array, cosine: Array) -> Array:
    """By how much a ray that hits a sphere passes inside its silhouette; infinite for flat shapes."""
    with np.errstate(invalid="ignore"):
        inside = radius * (1 - np.sqrt(np.maximum(0, 1 - cosine**2)))
    return np.where(np.isfinite(radius), inside, np.inf)


def compare_distance(case: Case, kind: str) -> Outcome:
    """|dt cos| in eps S; for Mitsuba's triangles times their condition."""
    at, rays, theirs = agreed(case, kind), case.bench.rays, case.bench.theirs
    ours_t = case.ours.t[at.k]
    theirs_t = ((theirs.p[at.k] - rays.o[at.k]) * at.d).sum(axis=1)
    unit = at.extent / at.cosine
    numbers = Numbers(
        rays=rays,
        index=at.k,
        difference=np.abs(ours_t - theirs_t) / (SINGLE * unit * at.condition),
        ours=np.abs(ours_t - at.t) / (case.epsilon * unit),
        mitsuba=np.abs(theirs_t - at.t) / (SINGLE * unit * at.condition),
        unit="eps S / cos",
        answers=lambda i: (f"t = {ours_t[i]!s}", f"t = {theirs_t[i]!s}", f"t = {at.t[i]!s}"),
        ulp=(case.ulps(ours_t - at.t, at.t), case.bench.ulps(theirs_t - at.t, at.t)),
        left_out=at.left_out,
    )
    return judge_numbers(case, f"distance, {kind}", numbers, bounds(case, "distance", f"mitsuba {kind}"))


def compare_normal(case: Case, kind: str) -> Outcome:
    """The largest difference of a component in eps S / (r cos); flat shapes: in eps (Mitsuba's triangles
    times their condition)."""
    at = agreed(case, kind)
    ours, theirs = case.ours.normal[at.k], case.bench.theirs.n[at.k]
    flat = ~np.isfinite(at.radius)
    unit = np.where(flat, 1, at.extent / (np.where(flat, 1, at.radius) * at.cosine))
    difference, own, other = (
        np.abs(a - b).max(axis=1, initial=0)
        for a, b in ((ours, theirs), (ours, at.normal), (theirs, at.normal))
    )
    numbers = Numbers(
        rays=case.bench.rays,
        index=at.k,
        difference=difference / (SINGLE * unit * at.condition),
        ours=own / (case.epsilon * unit),
        mitsuba=other / (SINGLE * unit * at.condition),
        unit="eps S / (r cos)",
        answers=lambda i: (f"normal {ours[i]}", f"normal {theirs[i]}", f"normal {at.normal[i]}"),
        ulp=(case.ulps(own), case.bench.ulps(other)),
        left_out=at.left_out,
    )
    return judge_numbers(case, f"normal, {kind}", numbers, bounds(case, "normal", "mitsuba normal"))


def compare_position(case: Case, kind: str) -> Outcome:
    """|dp.n| and |dp| cos, the larger of the two, in eps S; Mitsuba's point is o + t d, so its error is that
    of the distance."""
    at, rays, theirs = agreed(case, kind), case.bench.rays, case.bench.theirs
    exact = rays.o[at.k] + at.t[:, None] * at.d
    ours, other = (off_surface(p[at.k] - exact, at.normal, at.cosine) for p in (case.ours.position, theirs.p))
    apart = off_surface(case.ours.position[at.k] - theirs.p[at.k], at.normal, at.cosine)
    unit = at.extent
    numbers = Numbers(
        rays=rays,
        index=at.k,
        difference=apart / (SINGLE * unit * at.condition),
        ours=ours / (case.epsilon * unit),
        mitsuba=other / (SINGLE * unit * at.condition),
        unit="eps S",
        answers=lambda i: tuple(  # type: ignore[arg-type, return-value]
            f"position {p}" for p in (case.ours.position[at.k[i]], theirs.p[at.k[i]], exact[i])
        ),
        ulp=(case.ulps(ours, unit), case.bench.ulps(other, unit)),
        left_out=at.left_out,
    )
    return judge_numbers(case, f"position, {kind}", numbers, bounds(case, "position", f"mitsuba {kind}"))


def off_surface(dp: Array, normal: Array, cosine: Array) -> Array:
    """(n,) the error of points: across the surface, and in all, which may be as large as that over the cosine
    of arrival."""
    return np.maximum(np.abs((dp * normal).sum(axis=1)), np.linalg.norm(dp, axis=1) * cosine)


def terms() -> list[Term]:
    """One term of ids, and three of numbers for each kind of shape."""
    return [
        Term("hits", "hit mask, shape and primitive of primary and free rays", has_shapes, compare_ids),
        *by_kind("distance", "distance along the ray to a hit, |dt cos|", compare_distance),
        *by_kind("normal", "outward geometric normal at a hit", compare_normal),
        *by_kind("position", "position of a hit, |dp.n| and |dp| cos", compare_position),
    ]
