"""From errors to a verdict: how large they are, whose they are, and which ray shows it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from reference.comparison import grazing
from reference.comparison.case import Case, sizes
from reference.comparison.rays import RaySet
from reference.comparison.records import Guilty, Outcome, Replay, Spectrum
from reference.tolerances import EPSILON, TOLERANCES

Array = np.ndarray

Sides: TypeAlias = tuple[str, str, str]
"""What ours, Mitsuba and extended precision say, in words."""

SAMPLES = 500
"""Rays of an outcome whose difference and distance to a silhouette are kept for drawing, at most."""

SAMPLED_PAIRS = 200_000
"""Pairs of such a ray and an edge: scenes with many triangles have fewer samples."""

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
    answers: Callable[[int], Sides]
    ulp: tuple[Array, Array] | None = None
    left_out: int = 0


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
        excluded=numbers.left_out,
        excluded_allowed=share_of("left out", len(difference) + numbers.left_out),
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
        spectrum=None if numbers.ulp is None else Spectrum.of(*numbers.ulp),
    )


def share_of(name: str, rays: int) -> int:
    """How many of so many rays a row of the table of tolerances allows: its share, and of few rays as many
    more as chance brings once in a thousand runs (three times the root of a Poisson count)."""
    expected = TOLERANCES[name].value * rays
    return int(np.ceil(expected + 3 * np.sqrt(expected)))


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


def replay(case: Case, rays: RaySet, k: int, answers: Sides, in_band: bool = False) -> Replay:
    """The ray as a record, with the command that shows it again."""
    column, row = (int(x) for x in rays.pixel[k])
    return Replay(
        rays.o[k].tolist(),
        rays.d[k].tolist(),
        *answers,
        command=f"tracer validate {case.words or case.scene.name} {rays.options(k)}",
        pixel=(column, row) if column >= 0 else None,
        in_band=in_band,
    )
