"""Terms of chains in lockstep: what each step reaches, and where."""

from __future__ import annotations

import numpy as np

from reference import extended
from reference.comparison import grazing
from reference.comparison.case import HORIZON, Case, roundness, sizes
from reference.comparison.decisions import Answers, judge_ids
from reference.comparison.hits import farther, rim_clearance
from reference.comparison.judge import SINGLE, Numbers, bounds, judge_numbers
from reference.comparison.kinds import by_kind, has_shapes
from reference.comparison.records import Outcome, Term
from reference.comparison.steps import agreed_steps, is_near, parted, steps
from reference.tolerances import TOLERANCES

Array = np.ndarray


def compare_next_hit(case: Case) -> Outcome:
    """What each step of a chain reaches: the same primitive, and a sphere on the same side."""
    truth, s = case.bench.truth, steps(case)
    ours_t, theirs_t = (np.nan_to_num(np.linalg.norm(p - s.o, axis=1)) for p in (s.p, s.theirs_p))

    def distance(k: Array) -> Array:
        """Also where Mitsuba's step begins next to a surface, or ours ends before that, half of how far apart
        both hits are, and the horizon."""
        near = s.part(k)
        reach = np.maximum(ours_t, theirs_t)[k]
        off = grazing.silhouette_distance(truth, near.origin, near.way, farther(ours_t, theirs_t)[k])
        off = np.where(reach > HORIZON * case.bench.mitsuba.extent, 0, off)
        off = np.minimum(off, grazing.start_distance(truth, near.origin))
        both = (near.shape >= 0) & (near.theirs_shape >= 0)
        off = np.where(both, np.minimum(off, np.abs(ours_t - theirs_t)[k] / 2), off)
        return np.where((near.shape >= 0) & is_near(case, near, near.p, near.o), 0, off)

    return judge_ids(
        case,
        "lockstep, next hit",
        s.rays,
        Answers(s.shape, s.primitive),
        Answers(s.theirs_shape, s.theirs_primitive),
        distance,
        apart=parted(case, s),
    )


def compare_next_vertex(case: Case, kind: str) -> Outcome:
    """|dt cos| of the steps from the second vertex on, in eps S."""
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
    across, their_across = ours * (cosine / extent)[k], theirs * (their_cosine / extent)[k]
    numbers = Numbers(
        rays=s.rays,
        index=k,
        difference=np.abs(across - their_across) / (SINGLE * condition[k]),
        ours=np.abs(across) / case.epsilon,
        mitsuba=np.abs(their_across) / (SINGLE * condition[k]),
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
