"""Terms of chains in lockstep: what each step reaches, and where."""

from __future__ import annotations

import numpy as np

from reference import extended
from reference.comparison import grazing
from reference.comparison.case import Case, roundness, sizes
from reference.comparison.decisions import Answers, Questions, judge_ids, tie_or_edge, true_answers
from reference.comparison.hits import off_surface, rim_clearance
from reference.comparison.judge import SINGLE, Numbers, bounds, judge_numbers
from reference.comparison.kinds import by_kind, has_shapes
from reference.comparison.records import Outcome, Term
from reference.comparison.steps import Steps, agreed_steps, is_near, parted, steps
from reference.comparison.truth import SPHERE, Truth
from reference.tolerances import TOLERANCES

Array = np.ndarray


def compare_next_hit(case: Case) -> Outcome:
    """What each step of a chain reaches: the same primitive, and a sphere on the same side."""
    truth, s = case.bench.truth, steps(case)
    ours_t, theirs_t = (np.linalg.norm(p - s.o, axis=1) for p in (s.p, s.theirs_p))
    ours, theirs = (
        Answers(s.shape, s.primitive, ours_t),
        Answers(s.theirs_shape, s.theirs_primitive, theirs_t),
    )

    def ours_true(k: Array) -> Answers:
        return Answers(*truth.nearest(s.o[k], s.d[k], (s.left[k], s.left_primitive[k])))

    def distance(k: Array) -> Array:
        """Also half of how far apart the two hits are, where two surfaces meet and both may be right; and by
        how much a ray that leaves a sphere grazes it."""
        both = (s.shape[k] >= 0) & (s.theirs_shape[k] >= 0)
        off = np.minimum(tie_or_edge(case, s.rays, k, ours, theirs), rim_left(truth, s.part(k)))
        return np.where(both, np.minimum(off, np.abs(ours_t - theirs_t)[k] / 2), off)

    def starts(k: Array) -> Array:
        """How far Mitsuba's step begins from a surface; 0 where ours meets one before it."""
        near = s.part(k)
        off = grazing.start_distance(truth, near.origin)
        return np.where(is_near(case, near, near.p, near.o), 0, off)

    asked = Questions(
        s.rays,
        ours,
        theirs,
        ours_true=ours_true,
        mitsuba_true=true_answers(case, s.rays),
        distance=distance,
        starts=starts,
        apart=parted(case, s),
    )
    return judge_ids(case, "lockstep, next hit", asked)


def rim_left(truth: Truth, s: Steps) -> Array:
    """(n,) how far the rim of the sphere that a ray leaves is from its line; infinite for other shapes."""
    gap = np.full(len(s), np.inf)
    k = np.flatnonzero((s.left >= 0) & (truth.kind[s.left] == SPHERE))
    row = truth.rows[s.left[k]]
    way = s.d[k] / np.linalg.norm(s.d[k], axis=1, keepdims=True)
    closest = np.linalg.norm(np.cross(s.o[k] - row[:, :3], way), axis=1)
    gap[k] = np.abs(row[:, 3] - closest)
    return gap


def compare_next_vertex(case: Case, kind: str) -> Outcome:
    """|dt cos| of the steps from the second vertex on, for ours |dp.n| and |dp| cos, in eps S."""
    truth, (s, sure) = case.bench.truth, agreed_steps(case)
    wanted = (s.vertex > 0) & (truth.kind[s.shape] == kind)
    s, sure = s.part(wanted), sure[wanted]
    way, rounded = extended.unit(s.d), extended.unit(s.way)
    t, normal = (extended.double(x) for x in truth.hit(s.o, way, s.shape, s.primitive, s.left))
    their_t, their_normal = (
        extended.double(x) for x in truth.hit(s.origin, rounded, s.shape, s.primitive, s.left)
    )
    way, rounded = extended.double(way), extended.double(rounded)
    cosine, their_cosine = np.abs((normal * way).sum(axis=1)), np.abs((their_normal * rounded).sum(axis=1))
    radius, condition = roundness(truth, s.shape, s.primitive)
    extent = sizes(truth, s.o, s.p)
    their_clear = rim_clearance(radius, their_cosine)
    sure &= their_clear > TOLERANCES["grazing band"].value * SINGLE * extent
    k = np.flatnonzero(sure & ~is_near(case, s, s.p, s.o))
    ours = (((s.p - s.o) * way).sum(axis=1) - t)[k]
    theirs = (((s.theirs_p - s.origin) * rounded).sum(axis=1) - their_t)[k]
    exact = (s.o + t[:, None] * way)[k]
    across = off_surface(s.p[k] - exact, normal[k], cosine[k]) / extent[k]
    their_across = np.abs(theirs) * (their_cosine / extent)[k]
    apart = np.abs(ours * cosine[k] - theirs * their_cosine[k]) / extent[k]
    numbers = Numbers(
        rays=s.rays,
        index=k,
        difference=apart / (SINGLE * condition[k]),
        ours=across / case.epsilon,
        mitsuba=their_across / (SINGLE * condition[k]),
        unit="eps S / cos",
        answers=lambda i: (
            f"vertex {s.p[k[i]]} of shape {s.shape[k[i]]}",
            f"vertex {s.theirs_p[k[i]]}",
            f"t = {t[k[i]]!s} from {s.o[k[i]].tolist()} along {s.d[k[i]].tolist()}",
        ),
        ulp=(case.ulps(ours, t[k]), case.bench.ulps(theirs, their_t[k])),
        left_out=len(s) - len(k),
    )
    allowed = bounds(case, "next vertex", "mitsuba next vertex")
    return judge_numbers(case, f"lockstep, next vertex, {kind}", numbers, allowed)


def terms() -> list[Term]:
    """Next hit, and next vertex by kind of shape."""
    return [
        Term(
            "lockstep, next hit",
            "what each of up to 8 steps of a chain reaches",
            has_shapes,
            compare_next_hit,
        ),
        *by_kind("lockstep, next vertex", "where a step reaches it, |dt cos|", compare_next_vertex),
    ]
