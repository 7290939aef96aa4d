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

ELSEWHERE = 0.5
"""Share of a distance by which the same primitive is met at another place: the other root of a sphere."""

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


def judge_decisions(case: Case, term: str, decisions: Decisions, share: str = "grazing rays") -> Outcome:
    """The verdict: none may differ outside the band, few inside; `share`: the tolerance that says how few."""
    rays = decisions.rays
    differ = np.flatnonzero(decisions.differ)
    near = differ[:LOOKED_AT]
    inside = decisions.in_band(near)
    outside = np.concatenate([near[~inside], differ[LOOKED_AT:]])
    listed = [(int(k), False) for k in outside[:LISTED]]
    listed += [(int(k), True) for k in near[inside][: LISTED - len(listed)]]
    differing = tuple(replay(case, rays, k, decisions.answers(k), in_band) for k, in_band in listed)
    allowed = share_of(share, len(rays))
    suspects = outside if len(outside) or inside.sum() <= allowed else near[inside]
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
        excluded_allowed=allowed,
        guilty=_guilty(*decisions.wrong(suspects[:JUDGED])) if len(suspects) else "",
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
    """Shape and primitive (n,) that one side hits, -1 on a miss, and the distance `t`."""

    shape: Array
    primitive: Array
    t: Array

    def at(self, k: int) -> str:
        """In words."""
        if self.shape[k] < 0:
            return "misses"
        return f"hits shape {self.shape[k]}, primitive {self.primitive[k]} at t = {self.t[k]:.9g}"

    def differ(self, other: Answers) -> Array:
        """Mask: the other side hits something else."""
        return np.asarray((self.shape != other.shape) | (self.primitive != other.primitive))

    def part(self, k: Array) -> Answers:
        """Of some rays, by number or mask."""
        return Answers(self.shape[k], self.primitive[k], self.t[k])


@dataclass(frozen=True)
class Questions:
    """What is asked: `rays`, that a replay shows again, and the answers of both sides. Functions of some
    rays, by number, in extended precision: `ours_true`, `mitsuba_true`, what each side should have answered
    to what it was asked; `distance`, by how much they miss the nearest silhouette, edge or tie; `starts`, how
    far they start from a surface. `apart` (n,): the same primitive is met at places far apart."""

    rays: RaySet
    ours: Answers
    mitsuba: Answers
    ours_true: Callable[[Array], Answers]
    mitsuba_true: Callable[[Array], Answers]
    distance: Callable[[Array], Array]
    starts: Callable[[Array], Array]
    apart: Array | None = None


def judge_ids(case: Case, term: str, asked: Questions, share: str = "grazing rays") -> Outcome:
    """The verdict on what rays hit. Next to a silhouette, an edge or a tie both sides may be right; a start
    next to a surface excuses a difference only where ours is right."""

    def in_band(k: Array) -> Array:
        band = TOLERANCES["grazing band"].value * SINGLE * sizes(case.bench.truth, asked.rays.o[k])
        inside = asked.distance(k) <= band
        doubtful = np.flatnonzero(~inside & (asked.starts(k) <= band))
        inside[doubtful] = ~_is_wrong(asked.ours, asked.ours_true, k[doubtful])
        return np.asarray(inside)

    def wrong(k: Array) -> tuple[Array, Array]:
        return _is_wrong(asked.ours, asked.ours_true, k), _is_wrong(asked.mitsuba, asked.mitsuba_true, k)

    def answers(k: int) -> Sides:
        return asked.ours.at(k), asked.mitsuba.at(k), asked.ours_true(np.array([k])).at(0)

    differ = asked.ours.differ(asked.mitsuba)
    if asked.apart is not None:
        differ = differ | asked.apart
    return judge_decisions(case, term, Decisions(asked.rays, differ, in_band, wrong, answers), share)


def _is_wrong(given: Answers, true: Callable[[Array], Answers], k: Array) -> Array:
    """Mask of some rays, by number: another primitive, or the same one at another place."""
    own, right = given.part(k), true(k)
    with np.errstate(invalid="ignore"):
        elsewhere = np.abs(own.t - right.t) > ELSEWHERE * np.maximum(own.t, right.t)
    return np.asarray(own.differ(right) | ((own.shape >= 0) & elsewhere))


def true_answers(case: Case, rays: RaySet) -> Callable[[Array], Answers]:
    """What free rays hit, in extended precision."""
    return lambda k: Answers(*case.bench.truth.nearest(rays.o[k], rays.d[k]))


def free_questions(
    case: Case,
    rays: RaySet,
    ours: Answers,
    mitsuba: Answers,
    apart: Callable[[Callable[[Array], Answers]], Array] | None = None,
) -> Questions:
    """The same rays for both sides, which leave no surface; `apart`: from what extended precision says of
    some rays to a mask of rays that count as different."""
    true = true_answers(case, rays)
    return Questions(
        rays,
        ours,
        mitsuba,
        ours_true=true,
        mitsuba_true=true,
        distance=lambda k: tie_or_edge(case, rays, k, ours, mitsuba),
        starts=lambda k: grazing.start_distance(case.bench.truth, rays.o[k]),
        apart=None if apart is None else apart(true),
    )


def tie_or_edge(case: Case, rays: RaySet, k: Array, ours: Answers, mitsuba: Answers) -> Array:
    """(n,) lengths by which some rays (by number) are off a silhouette, an edge or a tie of the two
    primitives that are named; 0 at the horizon of a plane."""
    truth, o, d = case.bench.truth, rays.o[k], rays.d[k]
    own, other = ours.part(k), mitsuba.part(k)
    farthest = np.maximum(*(np.where(side.shape >= 0, side.t, 0) for side in (own, other)))
    reach = np.where(farthest > 0, farthest, np.inf)
    distance = grazing.silhouette_distance(truth, o, d, reach)
    both = (own.shape >= 0) & (other.shape >= 0)
    both &= (own.shape != other.shape) | (truth.kind[own.shape] == MESH)  # no tie with itself
    a, b = (np.stack([side.shape[both], side.primitive[both]], axis=1) for side in (own, other))
    distance[both] = np.minimum(distance[both], grazing.tie_distance(truth, o[both], d[both], a, b))
    return np.where(farthest > HORIZON * case.bench.mitsuba.extent, 0, distance)
