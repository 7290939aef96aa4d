"""The term of chains that run freely: how the difference of the two tracers grows from bounce to bounce."""

from __future__ import annotations

import numpy as np

import tracer
from reference import extended
from reference.comparison import optics
from reference.comparison.case import Case, sizes
from reference.comparison.events import CHAIN_SHARE, CHAINS, bend_radius, step_length
from reference.comparison.hits import has_shapes
from reference.comparison.judge import SINGLE, replay, samples
from reference.comparison.rays import RaySet
from reference.comparison.records import Growth, Outcome, Term
from reference.tolerances import TOLERANCES

Array = np.ndarray

ENOUGH = 20
"""A median of fewer chains says nothing."""


def free_chain(case: Case, rays: RaySet, events: str) -> tuple[Array, Array, Array]:
    """Mitsuba's chains from vertex to vertex of its own: positions (n, k, 3), shapes and primitives (n, k),
    NaN and -1 where a chain has ended."""
    truth, n = case.bench.truth, len(rays)
    position, shape = np.full((n, len(events), 3), np.nan), np.full((n, len(events)), -1)
    primitive = shape.copy()
    o, d, going = rays.o, rays.d, np.arange(n)
    for vertex, event in enumerate(events):
        if not len(going):
            break
        hits = case.bench.mitsuba.intersect(o, d)
        met = np.flatnonzero(hits.valid)
        going, d, p, number = going[met], d[met], hits.p[met], hits.shape[met]
        which = hits.primitive[met]
        position[going, vertex], shape[going, vertex], primitive[going, vertex] = p, number, which
        normal, entering, _ = truth.shading(p, d, number, which)
        facing = extended.double(normal)
        if event == "R":
            d, total = optics.mirrored(d, facing), np.zeros(len(d), bool)
        else:
            d, total = _refracted(d, np.where(entering[:, None], facing, -facing), truth.ior[number])
        o = p + step_length(case, p)[:, None] * d
        o, d, going = o[~total], d[~total], going[~total]
    return position, shape, primitive


def _refracted(d: Array, outward: Array, ior: Array) -> tuple[Array, Array]:
    """Straight on through index 1, which Mitsuba's dielectric need not handle."""
    bent, total = d.copy(), np.zeros(len(d), bool)
    glass = ior != 1
    bent[glass], total[glass] = optics.refracted(d[glass], outward[glass], ior[glass])
    return bent, total


def compare_growth(case: Case) -> Outcome:
    """The distance between both tracers' vertices while they reach the same shapes, in units of what a bounce
    may do to an error: 1 + 2 t / (r cos) each. Its median, vertex by vertex."""
    rays = case.bench.rays.part(np.arange(0, len(case.bench.rays), CHAIN_SHARE))
    gaps, scaled, index = [], [], []
    for number, events in enumerate(CHAINS):
        k = np.arange(number, len(rays), len(CHAINS))
        gap, unit = _gaps(case, rays.part(k), events)
        gaps.append(gap)
        scaled.append(gap / unit)
        index.append(k)
    gap, ratio = np.concatenate(gaps), np.concatenate(scaled)
    growth = tuple(
        Growth(
            vertex=vertex + 1,
            chains=int(there.sum()),
            median=float(np.median(gap[there, vertex])),
            most=float(np.quantile(gap[there, vertex], 0.99)),
            scaled=float(np.median(ratio[there, vertex])),
            ours=float("nan"),
            mitsuba=float("nan"),
        )
        for vertex, there in enumerate(np.isfinite(ratio).T)
        if there.sum() >= ENOUGH
    )
    kept, distance = samples(case, rays, np.concatenate(index), None)
    allowed = TOLERANCES["chain growth"].value
    last = np.nan_to_num(ratio).max(axis=1, initial=0)
    measured = max((step.scaled for step in growth), default=0.0)
    worst = None
    if measured > allowed:
        worst_ray = int(np.concatenate(index)[np.argmax(last)])
        worst = replay(case, rays, worst_ray, ("see the command",) * 3)
    return Outcome(
        term="chain growth",
        scene=case.scene.name,
        precision=case.precision,
        backend=case.backend,
        rays=int(np.isfinite(ratio).sum()),
        measured=measured,
        allowed=allowed,
        unit=TOLERANCES["chain growth"].unit,
        guilty="unknown" if measured > allowed else "",
        worst=worst,
        samples=last[kept],
        distance_to_silhouette=distance,
        growth=growth,
    )


def _gaps(case: Case, rays: RaySet, events: str) -> tuple[Array, Array]:
    """(n, k) |dp| / S of each vertex, NaN where a chain has ended or the shapes have parted, and its unit."""
    truth = case.bench.truth
    path = tracer.trace_path(
        case.bench.scene, rays.o, rays.d, events, precision=case.precision, backend=case.backend
    )
    position, shape, primitive = free_chain(case, rays, events)
    same = (np.cumprod(path.shape == shape, axis=1) == 1) & (path.shape >= 0)
    gap, unit = np.full(same.shape, np.nan), np.full(same.shape, np.nan)
    gain, o = np.ones(len(rays)), rays.o
    for vertex in range(len(events)):
        k = np.flatnonzero(same[:, vertex])
        p, number, which = path.position[k, vertex], shape[k, vertex], primitive[k, vertex]
        way = p - o[k]
        length = np.linalg.norm(way, axis=1)
        normal = extended.double(truth.outward(p, number, which))
        cosine = np.maximum(np.abs((normal * way).sum(axis=1)), 1e-9 * length) / np.maximum(length, 1e-300)
        extent = sizes(truth, o[k], p)
        gap[k, vertex] = np.linalg.norm(p - position[k, vertex], axis=1) / extent
        unit[k, vertex] = SINGLE * gain[k] / cosine
        gain[k] *= 1 + 2 * length / (bend_radius(truth, number, which) * cosine)
        o = np.where(same[:, vertex, None], path.position[:, vertex], o)
    return gap, unit


def terms() -> list[Term]:
    """The one term."""
    return [Term("chain growth", "chains that run freely, a statistic", has_shapes, compare_growth)]
