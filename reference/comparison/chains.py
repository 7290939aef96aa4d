"""The term of chains that run freely: how the difference of the two tracers grows from bounce to bounce, and
whose it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reference import extended
from reference.comparison import optics
from reference.comparison.bends import bend_radius
from reference.comparison.case import Case, once_a_case, sizes
from reference.comparison.judge import SINGLE, guilty_side, replay, samples
from reference.comparison.kinds import has_shapes
from reference.comparison.rays import StepRays
from reference.comparison.records import Growth, Outcome, Term
from reference.comparison.steps import Chains, chains, step_length
from reference.tolerances import TOLERANCES

Array = np.ndarray

ENOUGH = 20
"""A median of fewer chains says nothing."""

MOST = 10_000
"""Chains that run freely, at most: more do not move a median."""


@dataclass(frozen=True)
class Gaps:
    """Of n chains with k vertices, NaN where they have ended or reach different primitives: `between` the two
    tracers' vertices, `ours` and `mitsuba` from those of extended precision, all in S (n, k); `gain`: what
    the bounces so far may do to an error, over the cosine of arrival."""

    between: Array
    ours: Array
    mitsuba: Array
    gain: Array


@once_a_case
def free_chains(case: Case) -> Chains:
    """A part of our chains."""
    every = chains(case)
    return every.part(np.arange(0, len(every.rays), 1 + len(every.rays) // MOST))


def mitsuba_chains(case: Case) -> tuple[Array, Array, Array]:
    """Mitsuba's chains from vertex to vertex of its own: positions (n, k, 3), shapes and primitives (n, k),
    NaN and -1 where a chain has ended."""
    truth, ours = case.bench.truth, free_chains(case)
    rays, refracts = ours.rays, ours.refracts
    n, length = refracts.shape
    position, shape, primitive = np.full((n, length, 3), np.nan), *np.full((2, n, length), -1)
    o, d, going = rays.o, rays.d, np.arange(n)
    for vertex in range(length):
        if not len(going):
            break
        hits = case.bench.mitsuba.intersect(o, d)
        met = np.flatnonzero(hits.valid)
        going, d, p, number, which = going[met], d[met], hits.p[met], hits.shape[met], hits.primitive[met]
        position[going, vertex], shape[going, vertex], primitive[going, vertex] = p, number, which
        normal, entering, _ = truth.shading(p, d, number, which)
        d, total = _bent(d, extended.double(normal), entering, truth.ior[number], refracts[going, vertex])
        o = p + step_length(case, p)[:, None] * d
        o, d, going = o[~total], d[~total], going[~total]
    return position, shape, primitive


def _bent(d: Array, facing: Array, entering: Array, ior: Array, refracts: Array) -> tuple[Array, Array]:
    """Directions (n, 3) after the events by Mitsuba's materials, and masks of total reflection. Index 1 lets
    rays go straight on, which Mitsuba's dielectric need not handle."""
    out, total = d.copy(), np.zeros(len(d), bool)
    k = np.flatnonzero(~refracts)
    out[k] = optics.mirrored(d[k], facing[k])
    k = np.flatnonzero(refracts & (ior != 1))
    outward = np.where(entering[:, None], facing, -facing)
    out[k], total[k] = optics.refracted(d[k], outward[k], ior[k])
    return out, total


def exact_chains(case: Case, same: Array) -> Array:
    """(n, k, 3) vertices of the chains in extended precision, rounded to doubles, along the primitives that
    our chains reach, as far as `same` (n, k) says."""
    truth, ours = case.bench.truth, free_chains(case)
    rays, path, refracts = ours.rays, ours.path, ours.refracts
    position = np.full((*same.shape, 3), np.nan)
    k, o, d = np.arange(len(rays)), extended.number(rays.o), extended.unit(rays.d)
    left = np.full(len(k), -1)
    for vertex in range(same.shape[1]):
        on = same[k, vertex]
        k, o, d, left = k[on], o[on], d[on], left[on]
        if not len(k):
            break
        number, which = path.shape[k, vertex], path.primitive[k, vertex]
        t, _ = truth.hit(o, d, number, which, left)
        o, left = o + t[:, None] * d, number
        position[k, vertex] = extended.double(o)
        normal, entering, _ = truth.shading(o, d, number, which)
        ior = extended.number(truth.ior[number])
        bent, _ = extended.refract(d, normal, np.where(entering, 1 / ior, ior))
        straight = np.where((truth.ior[number] == 1)[:, None], d, bent)
        d = np.where(refracts[k, vertex][:, None], straight, extended.mirror(d, normal))
    return position


def gaps(case: Case) -> Gaps:
    """How far apart the chains are, vertex by vertex."""
    truth, ours = case.bench.truth, free_chains(case)
    rays, path = ours.rays, ours.path
    theirs, shape, primitive = mitsuba_chains(case)
    same = (path.shape == shape) & (path.primitive == primitive) & (path.shape >= 0)
    same = np.cumprod(same, axis=1) == 1
    exact = exact_chains(case, same)
    found = Gaps(*(np.full(same.shape, np.nan) for _ in range(4)))
    gain, o = np.ones(len(rays)), rays.o.copy()
    for vertex in range(same.shape[1]):
        k = np.flatnonzero(same[:, vertex])
        p, number, which = path.position[k, vertex], shape[k, vertex], primitive[k, vertex]
        way = p - o[k]
        length = np.linalg.norm(way, axis=1)
        normal = extended.double(truth.outward(p, number, which))
        cosine = np.maximum(np.abs((normal * way).sum(axis=1)), 1e-9 * length) / np.maximum(length, 1e-300)
        extent = sizes(truth, o[k], p)
        for gap, a, b in (
            (found.between, p, theirs[k, vertex]),
            (found.ours, p, exact[k, vertex]),
            (found.mitsuba, theirs[k, vertex], exact[k, vertex]),
        ):
            gap[k, vertex] = np.linalg.norm(a - b, axis=1) / extent
        found.gain[k, vertex] = gain[k] / cosine
        gain[k] *= 1 + 2 * length / (bend_radius(truth, number, which) * cosine)
        o[k] = p
    return found


def growth_of(gap: Array, between: Array, own: Array, other: Array) -> tuple[Growth, ...]:
    """Vertex by vertex the statistics of chains (n, k): `gap` in S, the others in eps S times the gain."""
    return tuple(
        Growth(
            vertex=vertex + 1,
            chains=int(there.sum()),
            median=float(np.median(gap[there, vertex])),
            most=float(np.quantile(gap[there, vertex], 0.99)),
            scaled=float(np.median(between[there, vertex])),
            ours=float(np.nanmedian(own[there, vertex])),
            mitsuba=float(np.nanmedian(other[there, vertex])),
        )
        for vertex, there in enumerate(np.isfinite(between).T)
        if there.sum() >= ENOUGH
    )


def compare_growth(case: Case) -> Outcome:
    """The distance between both tracers' vertices while they reach the same primitives, in units of what a
    bounce may do to an error: 1 + 2 t / (r cos) each. Its median, vertex by vertex."""
    found, ours = gaps(case), free_chains(case)
    ratios = [found.between / SINGLE, found.ours / case.epsilon, found.mitsuba / SINGLE]
    between, own, other = (ratio / found.gain for ratio in ratios)
    growth = growth_of(found.between, between, own, other)
    rays = StepRays(ours.rays.o, ours.rays.d, ours.rays.pixel, ours.rays, ours.events)
    last = np.nan_to_num(between).max(axis=1, initial=0)
    kept, distance = samples(case, rays, np.arange(len(rays)), None)
    allowed = TOLERANCES["chain growth"].value
    measured, own_most, other_most = (
        max((getattr(step, side) for step in growth), default=0.0) for side in ("scaled", "ours", "mitsuba")
    )
    broken = max(measured, own_most, other_most) > allowed
    worst = int(np.argmax(last)) if len(last) else None
    words = "a chain whose vertices are listed by the command"
    return Outcome(
        term="chain growth",
        scene=case.scene.name,
        precision=case.precision,
        backend=case.backend,
        rays=int(np.isfinite(between).sum()),
        measured=measured,
        allowed=allowed,
        unit=TOLERANCES["chain growth"].unit,
        ours_error=own_most,
        ours_allowed=allowed,
        mitsuba_error=other_most,
        mitsuba_allowed=allowed,
        guilty=guilty_side(own_most / allowed, other_most / allowed) if broken else "",
        worst=None if worst is None else replay(case, rays, worst, (words,) * 3),
        samples=last[kept],
        distance_to_silhouette=distance,
        growth=growth,
    )


def terms() -> list[Term]:
    """The one term."""
    return [Term("chain growth", "chains that run freely, a statistic", has_shapes, compare_growth)]
