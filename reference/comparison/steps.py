"""Chains in lockstep, step by step: every bounce of our chain is a question of its own for Mitsuba.

Mitsuba is given our vertex and direction, rounded to single precision, so that no error grows from bounce to
bounce; extended precision is asked both our question and the rounded one, and what is compared is how far
each side is off its own.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

import tracer
from reference.comparison import grazing
from reference.comparison.case import Case, once_a_case, sizes
from reference.comparison.hits import rim_clearance
from reference.comparison.rays import RaySet, StepRays, single
from reference.comparison.truth import MESH, SPHERE, Truth
from reference.tolerances import EPSILON, TOLERANCES

Array = np.ndarray

CHAINS = ("RRRRRRRR", "TTTTTTTT", "RTRTRTRT", "TTRTTRTT")
"""The events of our chains; each string gets a fourth of the rays."""

CHAIN_SHARE = 4
"""One ray in so many becomes a chain."""

STEP = TOLERANCES["start step"].value
"""Mitsuba's rays start so far along themselves, in extents S."""

NEAR = 6
"""What is hit within so many of these steps is near the start: a ray that starts a step later may miss it."""


@dataclass(frozen=True)
class Chains:
    """The rays that become chains, the `events` of each (n,) in letters and as masks `refracts` (n, k) of the
    events T, and how our chains went."""

    rays: RaySet
    events: Array
    refracts: Array
    path: tracer.Paths

    def part(self, k: Array) -> Chains:
        """Some of the chains, by number."""
        path = tracer.Paths(**{name: column[k] for name, column in vars(self.path).items()})
        return Chains(self.rays.part(k), self.events[k], self.refracts[k], path)


@dataclass(frozen=True)
class Steps:
    """All steps of all chains, one row each: our ray leaves `o` (n, 3) on the primitive `left_primitive` of
    the shape `left` (-1: none) in direction `d` and reaches `p` on `shape`, `primitive` (NaN, -1: a miss);
    then comes the event `refracts` or a mirror, and the chain leaves in direction `out` (NaN: total
    reflection, or the chain's end). `origin`, `way`: what Mitsuba is asked; `theirs_p`, `theirs_shape`,
    `theirs_primitive`: its answer; `vertex` (n,): which step of its chain; `first_o`, `first_d`, `pixel`,
    `events`: with what the chain began."""

    o: Array
    d: Array
    left: Array
    left_primitive: Array
    p: Array
    shape: Array
    primitive: Array
    refracts: Array
    out: Array
    origin: Array
    way: Array
    theirs_p: Array
    theirs_shape: Array
    theirs_primitive: Array
    vertex: Array
    first_o: Array
    first_d: Array
    pixel: Array
    events: Array

    def __len__(self) -> int:
        return len(self.shape)

    def part(self, k: Array) -> Steps:
        """Some of the steps, by number or mask."""
        return Steps(*(getattr(self, f.name)[k] for f in fields(self)))

    @property
    def rays(self) -> RaySet:
        """The rays as Mitsuba was asked them."""
        first = RaySet(self.first_o, self.first_d, self.pixel)
        return StepRays(self.origin, self.way, self.pixel, first, self.events)


@once_a_case
def chains(case: Case) -> Chains:
    """Our chains through a part of the rays."""
    rays = case.bench.rays.part(np.arange(0, len(case.bench.rays), CHAIN_SHARE))
    kind = np.arange(len(rays)) % len(CHAINS)
    events = np.array(CHAINS)[kind]
    refracts = np.array([[event == "T" for event in row] for row in CHAINS])[kind]
    path = tracer.trace_path(
        case.bench.scene, rays.o, rays.d, events.tolist(), precision=case.precision, backend=case.backend
    )
    return Chains(rays, events, refracts, path)


@once_a_case
def steps(case: Case) -> Steps:
    """Our chains step by step, and Mitsuba's answers."""
    ours = chains(case)
    rays, path, refracts = ours.rays, ours.path, ours.refracts
    o, d, (left, left_primitive) = rays.o, rays.d, np.full((2, len(rays)), -1)
    going = np.full(len(rays), True)
    blocks: list[list[Array]] = []
    for vertex in range(refracts.shape[1]):
        k = np.flatnonzero(going)
        if not len(k) and blocks:
            break
        delta = np.zeros(len(k)) if vertex == 0 else step_length(case, o[k])
        origin, way = single(o[k] + delta[:, None] * d[k]), single(d[k])
        hits = case.bench.mitsuba.intersect(origin, way)
        out = path.direction[:, vertex]
        at_vertex = [a[k, vertex] for a in (path.position, path.shape, path.primitive)]
        blocks.append(
            [o[k], d[k], left[k], left_primitive[k], *at_vertex, refracts[k, vertex], out[k], origin, way]
            + [hits.p, hits.shape, hits.primitive, np.full(len(k), vertex)]
            + [rays.o[k], rays.d[k], rays.pixel[k], ours.events[k]]
        )
        going = going & (path.count > vertex) & np.isfinite(out).all(axis=1)
        o, d = path.position[:, vertex], out
        left, left_primitive = path.shape[:, vertex], path.primitive[:, vertex]
    return Steps(*(np.concatenate(columns) for columns in zip(*blocks, strict=True)))


def step_length(case: Case, o: Array) -> Array:
    """(n,) by how much Mitsuba's rays start later than ours."""
    return STEP * sizes(case.bench.truth, o)


def is_near(case: Case, s: Steps, p: Array, start: Array) -> Array:
    """Mask: points p (n, 3) lie within a few steps of where rays start; False for NaN."""
    return np.asarray(np.linalg.norm(p - start, axis=1) < NEAR * step_length(case, s.o))


def parted(case: Case, s: Steps) -> Array:
    """Mask: both sides reach the sphere that the ray leaves, one of them again at once, as rounding may have
    it, the other where the ray has crossed it."""
    again = (s.left == s.shape) & (s.left == s.theirs_shape)
    return np.asarray(again & (is_near(case, s, s.p, s.o) != is_near(case, s, s.theirs_p, s.origin)))


@once_a_case
def agreed_steps(case: Case) -> tuple[Steps, Array]:
    """The steps that reach the same primitive at the same place, and a mask of those away from the edges of
    triangles and the rims of spheres, where normal and side are in doubt."""
    truth, s = case.bench.truth, steps(case)
    same = (s.shape == s.theirs_shape) & (s.primitive == s.theirs_primitive)
    s = s.part((s.shape >= 0) & same & ~parted(case, s))
    band = TOLERANCES["grazing band"].value * EPSILON["single"] * sizes(truth, s.o, s.p)
    return s, clearance(truth, s) > band


def clearance(truth: Truth, s: Steps) -> Array:
    """(n,) by how much the steps of a chain miss the edges of the triangle or the rim of the sphere that they
    reach."""
    clear = np.full(len(s), np.inf)
    k = np.flatnonzero(truth.kind[s.shape] == MESH)
    clear[k] = grazing.inner_distance(s.p[k], truth.triangles(s.shape[k], s.primitive[k]))
    k = np.flatnonzero(truth.kind[s.shape] == SPHERE)
    radius = truth.rows[s.shape[k], 3]
    cosine = np.abs(((s.p[k] - truth.rows[s.shape[k], :3]) * s.d[k]).sum(axis=1)) / radius
    clear[k] = rim_clearance(radius, cosine)
    return clear
