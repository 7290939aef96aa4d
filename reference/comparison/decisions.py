"""The verdict on decisions: what a ray hits, whether a light is seen, whether reflection is total.

Away from the places where rounding decides, both sides must decide alike; near them, in the grazing band,
rays may differ, and are counted, bounded and listed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from reference.comparison import grazing
from reference.comparison.case import HORIZON, Case, sizes
from reference.comparison.judge import SINGLE, Sides, replay, samples, share_of
from reference.comparison.rays import RaySet
from reference.comparison.records import Guilty, Outcome
from reference.comparison.truth import MESH
from reference.tolerances import TOLERANCES

Array = np.ndarray

LOOKED_AT = 1000
"""Differing rays whose distance to the grazing band is computed; more count as outside it."""

JUDGED = 20
"""Differing rays outside the band for which extended precision says who is wrong."""

LISTED = 12
"""Differing rays that an outcome lists."""


@dataclass(frozen=True)
class Decisions:
    """Decisions of both sides on n rays. `differ` (n,): they are not alike. Functions of some rays, by
    number: `in_band`, masks of those that may differ; `wrong`, masks of our mistakes and of Mitsuba's;
    `answers`, of one ray, in words."""

    rays: RaySet
    differ: Array
    in_band: Callable[[Array], Array]
    wrong: Callable[[Array], tuple[Array, Array]]
    answers: Callable[[int], Sides]


def judge_decisions(case: Case, term: str, decisions: Decisions) -> Outcome:
    """The verdict: none may differ outside the band, few inside."""
    rays = decisions.rays
    differ = np.flatnonzero(decisions.differ)
    near = differ[:LOOKED_AT]
    inside = decisions.in_band(near)
    outside = np.concatenate([near[~inside], differ[LOOKED_AT:]])
    listed = [(int(k), False) for k in outside[:LISTED]]
    listed += [(int(k), True) for k in near[inside][: LISTED - len(listed)]]
    differing = tuple(replay(case, rays, k, decisions.answers(k), in_band) for k, in_band in listed)
    kept, silhouette = samples(case, rays, np.arange(len(rays)), None)
    return Outcome(
        term=term,
        scene=case.scene.name,
        precision=case.precision,
        backend=case.backend,
        rays=len(rays),
        measured=float(len(outside)),
        allowed=0.0,
        unit="rays",
        excluded=int(inside.sum()),
        excluded_allowed=share_of("grazing rays", len(rays)),
        guilty=_guilty(*decisions.wrong(outside[:JUDGED])) if len(outside) else "",
        worst=differing[0] if differing else None,
        samples=decisions.differ[kept].astype(np.float64),
        distance_to_silhouette=silhouette,
        differing=differing,
    )


def _guilty(ours: Array, mitsuba: Array) -> Guilty:
    if ours.any() and mitsuba.any():
        return "both"
    if ours.any():
        return "ours"
    return "mitsuba" if mitsuba.any() else "unknown"


@dataclass(frozen=True)
class Answers:
    """Shape and primitive (n,) that one side hits, -1 on a miss."""

    shape: Array
    primitive: Array

    def at(self, k: int) -> str:
        """In words."""
        if self.shape[k] < 0:
            return "misses"
        return f"hits shape {self.shape[k]}, primitive {self.primitive[k]}"

    def differ(self, other: Answers) -> Array:
        """Mask: the other side hits something else."""
        return np.asarray((self.shape != other.shape) | (self.primitive != other.primitive))

    def part(self, k: Array) -> Answers:
        """Of some rays, by number or mask."""
        return Answers(self.shape[k], self.primitive[k])


def judge_ids(
    case: Case,
    term: str,
    rays: RaySet,
    ours: Answers,
    mitsuba: Answers,
    distance: Callable[[Array], Array],
    apart: Array | None = None,
) -> Outcome:
    """The verdict on what rays hit. `distance`: by how much some rays (by number) miss the nearest place
    where rounding decides; `apart` (n,): rays that hit the same primitive at places far apart."""

    def truth(k: Array) -> Answers:
        return Answers(*case.bench.truth.nearest(rays.o[k], rays.d[k])[:2])

    def in_band(k: Array) -> Array:
        band = TOLERANCES["grazing band"].value * SINGLE * sizes(case.bench.truth, rays.o[k])
        return distance(k) <= band

    def wrong(k: Array) -> tuple[Array, Array]:
        right = truth(k)
        return ours.part(k).differ(right), mitsuba.part(k).differ(right)

    def answers(k: int) -> Sides:
        return ours.at(k), mitsuba.at(k), truth(np.array([k])).at(0)

    differ = ours.differ(mitsuba)
    if apart is not None:
        differ = differ | apart
    return judge_decisions(case, term, Decisions(rays, differ, in_band, wrong, answers))


def hit_distance(case: Case, rays: RaySet, k: Array, ours: Answers, mitsuba: Answers, reach: Array) -> Array:
    """(n,) lengths by which some rays (by number) are off a silhouette, an edge, a tie of the two primitives
    that are named, or start off a surface; 0 at the horizon of a plane. `reach` (all rays): distance of the
    farther hit."""
    truth, o, d = case.bench.truth, rays.o[k], rays.d[k]
    distance = grazing.silhouette_distance(truth, o, d, reach[k])
    distance = np.minimum(distance, grazing.start_distance(truth, o))
    both = (ours.shape[k] >= 0) & (mitsuba.shape[k] >= 0)
    both &= (ours.shape[k] != mitsuba.shape[k]) | (truth.kind[ours.shape[k]] == MESH)  # no tie with itself
    i = k[both]
    a, b = (np.stack([side.shape[i], side.primitive[i]], axis=1) for side in (ours, mitsuba))
    distance[both] = np.minimum(distance[both], grazing.tie_distance(truth, o[both], d[both], a, b))
    farthest = np.where(np.isfinite(reach[k]), reach[k], 0)
    horizon = farthest > HORIZON * case.bench.mitsuba.extent
    return np.where(horizon, 0, distance)
