"""Terms of primary hits: what is hit; by kind of shape distance, normal and position."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reference.comparison.case import Case, roundness, truth_of_hits
from reference.comparison.decisions import Answers, hit_distance, judge_ids
from reference.comparison.judge import SINGLE, Numbers, bounds, judge_numbers
from reference.comparison.kinds import by_kind, has_shapes
from reference.comparison.records import Outcome, Term
from reference.tolerances import TOLERANCES

Array = np.ndarray


def compare_ids(case: Case) -> Outcome:
    """Hit mask, shape and primitive of every ray."""
    rays, hits, other = case.bench.rays, case.ours, case.bench.theirs
    ours, theirs = Answers(hits.shape, hits.primitive), Answers(other.shape, other.primitive)
    reach = farther(np.where(hits.valid, hits.t, 0), np.where(other.valid, other.t, 0))
    return judge_ids(
        case, "hits", rays, ours, theirs, lambda k: hit_distance(case, rays, k, ours, theirs, reach)
    )


def farther(a: Array, b: Array) -> Array:
    """(n,) the larger of two distances; infinite where neither is positive."""
    reach = np.maximum(a, b)
    return np.where(reach > 0, reach, np.inf)


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


def agreed(case: Case, kind: str) -> Agreed:
    """Where numbers can be compared; the rim of a sphere is left to the term of hits. Made once a case."""
    key = f"agreed {kind}"
    if key not in case.memory:
        case.memory[key] = _agreed(case, kind)
    found: Agreed = case.memory[key]
    return found


def _agreed(case: Case, kind: str) -> Agreed:
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
    """|dp . n| in eps S; Mitsuba's point is o + t d, so its error is that of the distance."""
    at, rays, theirs = agreed(case, kind), case.bench.rays, case.bench.theirs
    exact = rays.o[at.k] + at.t[:, None] * at.d
    ours, other = (((p[at.k] - exact) * at.normal).sum(axis=1) for p in (case.ours.position, theirs.p))
    unit = at.extent
    numbers = Numbers(
        rays=rays,
        index=at.k,
        difference=np.abs(ours - other) / (SINGLE * unit * at.condition),
        ours=np.abs(ours) / (case.epsilon * unit),
        mitsuba=np.abs(other) / (SINGLE * unit * at.condition),
        unit="eps S",
        answers=lambda i: tuple(  # type: ignore[arg-type, return-value]
            f"position {p}" for p in (case.ours.position[at.k[i]], theirs.p[at.k[i]], exact[i])
        ),
        ulp=(case.ulps(ours, unit), case.bench.ulps(other, unit)),
        left_out=at.left_out,
    )
    return judge_numbers(case, f"position, {kind}", numbers, bounds(case, "position", f"mitsuba {kind}"))


def terms() -> list[Term]:
    """One term of ids, and three of numbers for each kind of shape."""
    return [
        Term("hits", "hit mask, shape and primitive of primary and free rays", has_shapes, compare_ids),
        *by_kind("distance", "distance along the ray to a hit, |dt cos|", compare_distance),
        *by_kind("normal", "outward geometric normal at a hit", compare_normal),
        *by_kind("position", "position of a hit across the surface, |dp.n|", compare_position),
    ]
