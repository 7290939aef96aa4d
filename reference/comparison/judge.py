"""From differences to a verdict: how large, how many, whose error, and which ray shows it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from reference.comparison import grazing
from reference.comparison.case import HORIZON, Case, sizes
from reference.comparison.rays import RaySet
from reference.comparison.records import Guilty, Outcome, Replay
from reference.tolerances import EPSILON, TOLERANCES

Array = np.ndarray

SAMPLES = 500
"""Rays of an outcome whose difference and distance to a silhouette are kept for drawing, at most."""

SAMPLED_PAIRS = 200_000
"""Pairs of such a ray and an edge: scenes with many triangles have fewer samples."""

LOOKED_AT = 1000
"""Differing rays whose distance to the grazing band is computed; more count as outside it."""

JUDGED = 20
"""Differing rays for which extended precision asks every primitive of the scene."""

SINGLE = EPSILON["single"]


@dataclass(frozen=True)
class Bounds:
    """What is allowed: the difference of the two sides, our error, Mitsuba's."""

    difference: float
    ours: float
    mitsuba: float


@dataclass(frozen=True)
class Numbers:
    """Errors of k rays in units of their conditioning. `index` (k,): their numbers among `rays`; `difference`
    between the two sides and `mitsuba` in eps of single precision, `ours` in eps of our precision; `unit`: of
    what, in words; `answers`: what ours, Mitsuba and the closed form say of one of the k."""

    rays: RaySet
    index: Array
    difference: Array
    ours: Array
    mitsuba: Array
    unit: str
    answers: Callable[[int], tuple[str, str, str]]


def bounds(case: Case, ours: str, mitsuba: str) -> Bounds:
    """Rows of the table of tolerances: in single precision the difference may be as large as our error."""
    own, other = TOLERANCES[ours].value, TOLERANCES[mitsuba].value
    return Bounds(max(own, other) if case.precision == "single" else other, own, other)


def judge_numbers(case: Case, term: str, numbers: Numbers, allowed: Bounds) -> Outcome:
    """The verdict on errors."""
    difference, ours, mitsuba = (
        np.nan_to_num(e, nan=np.inf) for e in (numbers.difference, numbers.ours, numbers.mitsuba)
    )
    measured, our_error, their_error = (float(e.max(initial=0)) for e in (difference, ours, mitsuba))
    excess = np.maximum(difference / allowed.difference, ours / allowed.ours)
    excess = np.maximum(excess, mitsuba / allowed.mitsuba)
    worst = int(np.argmax(excess)) if len(excess) else None
    kept, distance = samples(case, numbers.rays, numbers.index, worst)
    broken = measured > allowed.difference or our_error > allowed.ours or their_error > allowed.mitsuba
    return Outcome(
        term=term,
        scene=case.scene.name,
        precision=case.precision,
        backend=case.backend,
        rays=len(difference),
        measured=measured,
        allowed=allowed.difference,
        unit=numbers.unit,
        ours_error=our_error,
        ours_allowed=allowed.ours,
        mitsuba_error=their_error,
        mitsuba_allowed=allowed.mitsuba,
        guilty=guilty_side(our_error / allowed.ours, their_error / allowed.mitsuba) if broken else "",
        worst=None
        if worst is None
        else replay(case, numbers.rays, numbers.index[worst], numbers.answers(worst)),
        samples=difference[kept],
        distance_to_silhouette=distance,
    )


def guilty_side(ours: float, mitsuba: float) -> Guilty:
    """Who broke a bound, from errors as multiples of what is allowed; where each keeps its own and the two
    differ too much all the same, the one that is nearer to its bound."""
    if ours > 1 and mitsuba > 1:
        return "both"
    return "ours" if ours >= mitsuba else "mitsuba"


def samples(case: Case, rays: RaySet, index: Array, worst: int | None) -> tuple[Array, Array]:
    """Some places in `index`, the worst among them, and the distances of these rays to a silhouette or edge
    in eps S of single precision."""
    rng = np.random.default_rng(case.seed)
    most = min(SAMPLES, SAMPLED_PAIRS // max(1, len(case.bench.truth.edges)))
    kept = np.sort(rng.permutation(len(index))[:most])
    if worst is not None and worst not in kept:
        kept = np.append(kept, worst)
    o, d = rays.o[index[kept]], rays.d[index[kept]]
    distance = grazing.silhouette_distance(case.bench.truth, o, d, np.full(len(kept), np.inf))
    return kept, distance / (SINGLE * sizes(case.bench.truth, o))


def replay(case: Case, rays: RaySet, k: int, answers: tuple[str, str, str]) -> Replay:
    """The ray as a record, with the command that shows it again."""
    o, d, name = rays.o[k].tolist(), rays.d[k].tolist(), case.scene.name
    scene = f"tracer.load({name!r})"
    where = name
    if name.startswith("random-"):
        seed = name.removeprefix("random-")
        scene, where = f"reference.random_scenes.random_scene({seed})", f"--random 1 --seed {seed}"
    column, row = rays.pixel[k]
    command = f"tracer.intersect({scene}, {o}, {d}, precision={case.precision!r})"
    if column >= 0:
        command = f"tracer validate {where} --pixel {column} {row}"
    return Replay(o, d, *answers, command=command)


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


def judge_ids(
    case: Case,
    term: str,
    rays: RaySet,
    ours: Answers,
    mitsuba: Answers,
    distance: Callable[[Array], Array],
) -> Outcome:
    """The verdict on what rays hit: outside the grazing band both sides must name the same primitive.

    `distance`: by how much some rays (by number) miss the nearest place where rounding decides.
    """
    differ = np.flatnonzero((ours.shape != mitsuba.shape) | (ours.primitive != mitsuba.primitive))
    near = differ[:LOOKED_AT]
    band = TOLERANCES["grazing band"].value * SINGLE * sizes(case.bench.truth, rays.o[near])
    inside = distance(near) <= band
    outside = np.concatenate([near[~inside], differ[LOOKED_AT:]])
    guilty, truth = guilty_of_ids(case, rays, outside[:JUDGED], ours, mitsuba)
    worst = None
    if len(differ):
        k = int(outside[0] if len(outside) else differ[0])
        worst = replay(case, rays, k, (ours.at(k), mitsuba.at(k), truth or "not asked"))
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
        excluded_allowed=grazing_allowed(len(rays)),
        guilty=guilty,
        worst=worst,
        samples=np.isin(kept, differ).astype(np.float64),
        distance_to_silhouette=silhouette,
    )


def grazing_allowed(rays: int) -> int:
    """How many of so many rays may differ in the grazing band."""
    return int(np.ceil(TOLERANCES["grazing rays"].value * rays))


def hit_distance(case: Case, rays: RaySet, k: Array, ours: Answers, mitsuba: Answers, reach: Array) -> Array:
    """(n,) lengths by which some rays (by number) are off a silhouette, an edge, a tie of the two primitives
    that are named, or 0 at the horizon of a plane. `reach` (all rays): distance of the farther hit."""
    truth, o, d = case.bench.truth, rays.o[k], rays.d[k]
    distance = grazing.silhouette_distance(truth, o, d, reach[k])
    both = (ours.shape[k] >= 0) & (mitsuba.shape[k] >= 0)
    i = k[both]
    a, b = (np.stack([side.shape[i], side.primitive[i]], axis=1) for side in (ours, mitsuba))
    distance[both] = np.minimum(distance[both], grazing.tie_distance(truth, o[both], d[both], a, b))
    farthest = np.where(np.isfinite(reach[k]), reach[k], 0)
    horizon = farthest > HORIZON * case.bench.mitsuba.extent
    return np.where(horizon, 0, distance)


def guilty_of_ids(case: Case, rays: RaySet, k: Array, ours: Answers, mitsuba: Answers) -> tuple[Guilty, str]:
    """Who names another primitive than extended precision does, and what that says of the first ray."""
    if not len(k):
        return "", ""
    shape, primitive, _ = case.bench.truth.nearest(rays.o[k], rays.d[k])
    wrong = [
        bool(((side.shape[k] != shape) | (side.primitive[k] != primitive)).any()) for side in (ours, mitsuba)
    ]
    guilty: Guilty = "both" if all(wrong) else "ours" if wrong[0] else "mitsuba"
    return guilty, Answers(shape, primitive).at(0)
