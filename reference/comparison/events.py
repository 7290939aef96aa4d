"""Terms of chains in lockstep: every bounce of our chain is a question of its own for Mitsuba.

Mitsuba is given our vertex and direction, rounded to single precision, so that no error grows from bounce to
bounce; extended precision is asked both our question and the rounded one, and what is compared is how far
each side is off its own.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

import tracer
from reference import extended
from reference.comparison import grazing, optics
from reference.comparison.case import HORIZON, Case, roundness, sizes
from reference.comparison.hits import farther, has_shapes, rim_clearance
from reference.comparison.judge import (
    SINGLE,
    Answers,
    Numbers,
    bounds,
    grazing_allowed,
    guilty_side,
    judge_ids,
    judge_numbers,
    replay,
    samples,
)
from reference.comparison.rays import RaySet, single
from reference.comparison.records import Outcome, Term
from reference.comparison.truth import MESH, SPHERE, Truth
from reference.tolerances import TOLERANCES

Array = np.ndarray

CHAINS = ("RRRRRRRR", "TTTTTTTT", "RTRTRTRT", "TTRTTRTT")
"""The events of our chains; each string gets a fourth of the rays."""

CHAIN_SHARE = 4
"""One ray in so many becomes a chain."""

STEP = 1e-5
"""Mitsuba's rays start so far along themselves, in extents S, so that they do not hit what they leave."""


@dataclass(frozen=True)
class Steps:
    """All steps of all chains, one row each: our ray leaves `o` (n, 3) on the shape `left` (-1: none) in
    direction `d` and reaches `p` on `shape` (NaN, -1: a miss); then comes the event `refracts` or a mirror,
    and the chain leaves in direction `out` (NaN: total reflection, or the chain's end). `origin`, `way`: what
    Mitsuba is asked; `theirs_p`, `theirs_shape`, `primitive`: its answer; `pixel` (n, 2), `vertex` (n,)."""

    o: Array
    d: Array
    left: Array
    p: Array
    shape: Array
    refracts: Array
    out: Array
    origin: Array
    way: Array
    theirs_p: Array
    theirs_shape: Array
    primitive: Array
    pixel: Array
    vertex: Array

    def part(self, k: Array) -> Steps:
        """Some of the steps, by number or mask."""
        return Steps(*(getattr(self, f.name)[k] for f in fields(self)))

    @property
    def rays(self) -> RaySet:
        """The rays as Mitsuba was asked them."""
        return RaySet(self.origin, self.way, self.pixel)


def steps(case: Case) -> Steps:
    """Our chains through a part of the rays, step by step, and Mitsuba's answers; made once a case."""
    if "steps" not in case.memory:
        rays = case.bench.rays.part(np.arange(0, len(case.bench.rays), CHAIN_SHARE))
        blocks = [_follow(case, rays.part(np.arange(k, len(rays), 4)), e) for k, e in enumerate(CHAINS)]
        case.memory["steps"] = Steps(
            *(np.concatenate([getattr(b, f.name) for b in blocks]) for f in fields(Steps))
        )
    found: Steps = case.memory["steps"]
    return found


def _follow(case: Case, rays: RaySet, events: str) -> Steps:
    path = tracer.trace_path(
        case.bench.scene, rays.o, rays.d, events, precision=case.precision, backend=case.backend
    )
    o, d, left = rays.o, rays.d, np.full(len(rays), -1)
    going = np.full(len(rays), True)
    blocks = []
    for vertex, event in enumerate(events):
        p, shape, out = path.position[:, vertex], path.shape[:, vertex], path.direction[:, vertex]
        k = np.flatnonzero(going)
        if not len(k):
            break
        delta = np.zeros(len(k)) if vertex == 0 else step_length(case, o[k])
        origin, way = single(o[k] + delta[:, None] * d[k]), single(d[k])
        hits = case.bench.mitsuba.intersect(origin, way)
        blocks.append(
            [o[k], d[k], left[k], p[k], shape[k], np.full(len(k), event == "T"), out[k], origin, way]
            + [hits.p, hits.shape, hits.primitive, rays.pixel[k], np.full(len(k), vertex)]
        )
        going = going & (path.count > vertex) & np.isfinite(out).all(axis=1)
        o, d, left = p, out, shape
    return Steps(*(np.concatenate(columns) for columns in zip(*blocks, strict=True)))


def step_length(case: Case, o: Array) -> Array:
    """(n,) by how much Mitsuba's rays start later than ours."""
    return STEP * sizes(case.bench.truth, o)


def parted(case: Case, s: Steps) -> Array:
    """Mask: both sides reach the same shape at places far apart. On a mesh our vertex is not in the plane of
    the triangle that Mitsuba names (`trace_path` names none itself); or Mitsuba's ray, which starts within
    rounding of the surface that it leaves, meets that surface again at once."""
    truth = case.bench.truth
    apart = np.zeros(len(s.shape), bool)
    k = np.flatnonzero((s.shape >= 0) & (s.shape == s.theirs_shape))
    step = 3 * step_length(case, s.o[k])
    again = (s.left[k] == s.shape[k]) & (np.linalg.norm(s.theirs_p[k] - s.origin[k], axis=1) < step)
    apart[k] = again & (np.linalg.norm(s.p[k] - s.o[k], axis=1) > 2 * step)
    k = k[truth.kind[s.shape[k]] == MESH]
    normal = extended.double(truth.outward(s.p[k], s.shape[k], s.primitive[k]))
    corner = truth.triangles(s.shape[k], s.primitive[k])[:, 0]
    height = np.abs(((s.p[k] - corner) * normal).sum(axis=1))
    apart[k] |= height > TOLERANCES["grazing band"].value * SINGLE * sizes(truth, s.o[k], s.p[k])
    return apart


def agreed_steps(case: Case) -> Steps:
    """The steps that reach the same shape at the same place, where the triangle is sure too: on an edge
    Mitsuba may name the neighbor of the one that our chain takes."""
    truth, s = case.bench.truth, steps(case)
    s = s.part((s.shape >= 0) & (s.shape == s.theirs_shape) & ~parted(case, s))
    sure = np.ones(len(s.shape), bool)
    k = np.flatnonzero(truth.kind[s.shape] == MESH)
    inner = grazing.inner_distance(s.p[k], truth.triangles(s.shape[k], s.primitive[k]))
    sure[k] = inner > TOLERANCES["grazing band"].value * SINGLE * sizes(truth, s.o[k], s.p[k])
    return s.part(sure)


def compare_next_hit(case: Case) -> Outcome:
    """What each step of a chain reaches: the same shape, and a point of the same triangle."""
    truth, s = case.bench.truth, steps(case)
    ours_t, theirs_t = (np.nan_to_num(np.linalg.norm(p - s.o, axis=1)) for p in (s.p, s.theirs_p))
    theirs = Answers(s.theirs_shape, s.primitive)
    same = (s.shape == s.theirs_shape) & ~parted(case, s)
    only = (s.shape >= 0) & (truth.kind[s.shape] != MESH)
    ours = Answers(s.shape, np.where(same, s.primitive, np.where(only, 0, -1)))

    def distance(k: Array) -> Array:
        """Also where Mitsuba's step begins next to a surface, or ours ends before that, half of how far apart
        both hits are, and the horizon."""
        reach = np.maximum(ours_t, theirs_t)[k]
        off = grazing.silhouette_distance(truth, s.origin[k], s.way[k], farther(ours_t, theirs_t)[k])
        off = np.where(reach > HORIZON * case.bench.mitsuba.extent, 0, off)
        off = np.minimum(off, grazing.start_distance(truth, s.origin[k]))
        both = (s.shape[k] >= 0) & (s.theirs_shape[k] >= 0)
        off = np.where(both, np.minimum(off, np.abs(ours_t - theirs_t)[k] / 2), off)
        return np.where((s.shape[k] >= 0) & (ours_t[k] < 3 * step_length(case, s.o[k])), 0, off)

    return judge_ids(case, "lockstep, next hit", s.rays, ours, theirs, distance)


def compare_next_vertex(case: Case) -> Outcome:
    """|dt cos| of the steps from the second vertex on, in eps S."""
    truth, s = case.bench.truth, agreed_steps(case)
    s = s.part(s.vertex > 0)
    way, rounded = extended.unit(s.d), extended.unit(s.way)
    t, normal = (extended.double(x) for x in truth.hit(s.o, way, s.shape, s.primitive, s.left))
    their_t, their_normal = (extended.double(x) for x in truth.hit(s.origin, rounded, s.shape, s.primitive))
    way, rounded = extended.double(way), extended.double(rounded)
    cosine, their_cosine = np.abs((normal * way).sum(axis=1)), np.abs((their_normal * rounded).sum(axis=1))
    radius, condition = roundness(truth, s.shape, s.primitive)
    extent = sizes(truth, s.o, s.p)
    clear = rim_clearance(radius, np.minimum(cosine, their_cosine))
    k = np.flatnonzero(
        (clear > TOLERANCES["grazing band"].value * SINGLE * extent)
        & (np.linalg.norm(s.p - s.o, axis=1) > 3 * step_length(case, s.o))
    )
    ours = (((s.p - s.o) * way).sum(axis=1) - t) * cosine / extent
    theirs = (((s.theirs_p - s.origin) * rounded).sum(axis=1) - their_t) * their_cosine / extent
    numbers = Numbers(
        rays=s.rays,
        index=k,
        difference=np.abs(ours - theirs)[k] / (SINGLE * condition[k]),
        ours=np.abs(ours)[k] / case.epsilon,
        mitsuba=np.abs(theirs)[k] / (SINGLE * condition[k]),
        unit="eps S / cos",
        answers=lambda i: (
            f"vertex {s.p[k[i]]} of shape {s.shape[k[i]]}",
            f"vertex {s.theirs_p[k[i]]}",
            f"t = {t[k[i]]!s} from {s.o[k[i]].tolist()} along {s.d[k[i]].tolist()}",
        ),
    )
    return judge_numbers(
        case, "lockstep, next vertex", numbers, bounds(case, "next vertex", "mitsuba next vertex")
    )


@dataclass(frozen=True)
class Bends:
    """The mirrors or refractions of all chains: the step of each, the normal (n, 3) that faces the ray and
    closed forms of the direction after it (NaN after total reflection), at the exact normal of our vertex;
    `k` = 1 - eta^2 (1 - c^2), `eta` and `curve` = S / r."""

    steps: Steps
    normal: Array
    exact: Array
    k: Array
    eta: Array
    entering: Array
    curve: Array


def bends(case: Case, refracts: bool) -> Bends:
    """The steps with that event at a vertex whose triangle is known; glass of index 1 is left out."""
    truth, s = case.bench.truth, agreed_steps(case)
    s = s.part(s.refracts == refracts)
    if refracts:
        s = s.part(truth.ior[s.shape] != 1)
    d = extended.unit(s.d)
    normal, entering, cosine = truth.shading(s.p, d, s.shape, s.primitive)
    ior = extended.number(truth.ior[s.shape])
    eta = np.where(entering, 1 / ior, ior)
    if refracts:
        exact, k = extended.refract(d, normal, eta)
    else:
        exact, k = extended.mirror(d, normal), extended.number(np.ones(len(cosine)))
    kept = cosine > 1e-4  # a smooth normal edge on: rounding decides whether it counts
    curve = sizes(truth, s.o, s.p) / bend_radius(truth, s.shape, s.primitive)
    columns = (extended.double(normal), extended.double(exact), extended.double(k), extended.double(eta))
    return Bends(s.part(kept), *(c[kept] for c in (*columns, entering, curve)))


def bend_radius(truth: Truth, shape: Array, primitive: Array) -> Array:
    """(n,) the length over which the normal turns: a sphere's radius, the least height of a triangle with
    interpolated normals; infinite for flat ones."""
    radius = np.full(len(shape), np.inf)
    ball = truth.kind[shape] == SPHERE
    radius[ball] = truth.rows[shape[ball], 3]
    k = np.flatnonzero((truth.kind[shape] == MESH) & ~truth.flat[shape])
    c = truth.triangles(shape[k], primitive[k])
    sides = np.stack([c[:, 1] - c[:, 0], c[:, 2] - c[:, 1], c[:, 0] - c[:, 2]], axis=1)
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    radius[k] = area / np.linalg.norm(sides, axis=2).max(axis=1, initial=0)
    return radius


def compare_direction(case: Case, refracts: bool) -> Outcome:
    """Directions after an event, in units of their conditioning; Mitsuba's at the same, rounded, normal."""
    b = bends(case, refracts)
    name = "refraction" if refracts else "mirror"
    d, n = single(extended.double(extended.unit(b.steps.d))), single(b.normal)
    exact_d, exact_n = extended.unit(d), extended.unit(n)
    if refracts:
        outward = np.where(b.entering[:, None], n, -n)
        theirs, total = optics.refracted(d, outward, case.bench.truth.ior[b.steps.shape])
        asked = extended.refract(exact_d, exact_n, extended.number(b.eta))[0]
        root, c = np.sqrt(np.maximum(b.k, 1e-300)), np.abs((b.normal * b.steps.d).sum(axis=1))
        gain = np.abs(b.eta * c - root) * (1 + b.eta / root)
        unit = 1 + (b.eta + b.eta**2) / root + b.curve * gain
        same_normal = 1 + (b.eta + b.eta**2) / root
        kept = (b.k > total_band(b, SINGLE)) & np.isfinite(b.steps.out).all(axis=1) & ~total
    else:
        theirs, asked = optics.mirrored(d, n), extended.mirror(exact_d, exact_n)
        unit, same_normal = 1 + 2 * b.curve, np.ones(len(b.curve))
        kept = np.isfinite(b.steps.out).all(axis=1)
    ours_error = b.steps.out - b.exact
    theirs_error = theirs - extended.double(asked)
    k = np.flatnonzero(kept)
    numbers = Numbers(
        rays=b.steps.rays,
        index=k,
        difference=np.abs(ours_error - theirs_error)[k].max(axis=1, initial=0) / (SINGLE * unit[k]),
        ours=np.abs(ours_error)[k].max(axis=1, initial=0) / (case.epsilon * unit[k]),
        mitsuba=np.abs(theirs_error)[k].max(axis=1, initial=0) / (SINGLE * same_normal[k]),
        unit=TOLERANCES[name].unit,
        answers=lambda i: (
            f"leaves {b.steps.p[k[i]].tolist()} along {b.steps.out[k[i]]}",
            f"along {theirs[k[i]]} at the rounded normal {n[k[i]].tolist()}",
            f"along {b.exact[k[i]]}",
        ),
    )
    return judge_numbers(case, name, numbers, bounds(case, name, "mitsuba direction"))


def total_band(b: Bends, epsilon: float) -> Array:
    """|k| below which rounding decides whether there is total reflection."""
    width = TOLERANCES["total reflection band"].value * epsilon
    return np.asarray(width * (1 + b.eta**2) * (1 + 2 * b.curve))


def compare_total_reflection(case: Case) -> Outcome:
    """Which refractions are total: ours, Mitsuba's and the sign of k."""
    b = bends(case, refracts=True)
    d, n = single(extended.double(extended.unit(b.steps.d))), single(b.normal)
    outward = np.where(b.entering[:, None], n, -n)
    _, theirs = optics.refracted(d, outward, case.bench.truth.ior[b.steps.shape])
    ours, exact = np.isnan(b.steps.out).any(axis=1), b.k < 0
    ours_wrong = (ours != exact) & (np.abs(b.k) > total_band(b, case.epsilon))
    theirs_wrong = (theirs != exact) & (np.abs(b.k) > total_band(b, SINGLE))
    doubtful = (ours != theirs) & ~ours_wrong & ~theirs_wrong
    wrong = np.flatnonzero(ours_wrong | theirs_wrong)
    worst = None
    if len(wrong):
        i = int(wrong[0])
        answers = ("total" if side[i] else "refracts" for side in (ours, theirs, exact))
        worst = replay(case, b.steps.rays, i, (*answers,))  # type: ignore[arg-type]
    kept, distance = samples(case, b.steps.rays, np.arange(len(exact)), None)
    return Outcome(
        term="total reflection",
        scene=case.scene.name,
        precision=case.precision,
        backend=case.backend,
        rays=len(exact),
        measured=float(len(wrong)),
        allowed=0.0,
        unit="rays",
        excluded=int(doubtful.sum()),
        excluded_allowed=grazing_allowed(len(exact)),
        ours_error=float(ours_wrong.sum()),
        ours_allowed=0.0,
        mitsuba_error=float(theirs_wrong.sum()),
        mitsuba_allowed=0.0,
        guilty=guilty_side(2.0 * ours_wrong.any(), 2.0 * theirs_wrong.any()) if len(wrong) else "",
        worst=worst,
        samples=(ours != theirs)[kept].astype(np.float64),
        distance_to_silhouette=distance,
    )


def has_glass(scene: tracer.Scene) -> bool:
    """Whether a material of the scene refracts."""
    return has_shapes(scene) and any(m.ior != 1 for m in scene.materials.values())


def terms() -> list[Term]:
    """Next hit and next vertex, mirror, refraction, total reflection."""
    return [
        Term(
            "lockstep, next hit",
            "what each of up to 8 steps of a chain reaches",
            has_shapes,
            compare_next_hit,
        ),
        Term("lockstep, next vertex", "where it reaches it, |dt cos|", has_shapes, compare_next_vertex),
        Term("mirror", "direction after a mirror", has_shapes, lambda case: compare_direction(case, False)),
        Term(
            "refraction", "direction after refraction", has_glass, lambda case: compare_direction(case, True)
        ),
        Term("total reflection", "where refraction is total", has_glass, compare_total_reflection),
    ]
