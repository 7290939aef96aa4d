"""Terms of directions: after a mirror and after refraction, at the same normal."""

from __future__ import annotations

import numpy as np

import tracer
from reference import extended
from reference.comparison import optics
from reference.comparison.bends import Bends, bends, total_band
from reference.comparison.case import Case
from reference.comparison.decisions import Decisions, judge_decisions
from reference.comparison.judge import SINGLE, Numbers, bounds, judge_numbers
from reference.comparison.kinds import by_kind, glass_kinds, has_shapes
from reference.comparison.records import Outcome, Term
from reference.comparison.steps import steps
from reference.tolerances import TOLERANCES

Array = np.ndarray


def compare_straight(case: Case) -> Outcome:
    """Through index 1 a ray goes straight on, exactly: directions after as before, bit for bit. Mitsuba has
    no say here."""
    truth, s = case.bench.truth, steps(case)
    crossed = s.refracts & (s.shape >= 0) & (s.vertex > 0)  # the first direction is normalized on the way
    s = s.part(crossed & (truth.ior[s.shape] == 1))
    bent = (s.out != s.d).any(axis=1)
    decisions = Decisions(
        rays=s.rays,
        differ=bent,
        in_band=lambda k: np.zeros(len(k), bool),
        wrong=lambda k: (bent[k], np.zeros(len(k), bool)),
        answers=lambda k: (f"goes on along {s.out[k].tolist()}", "not asked", f"along {s.d[k].tolist()}"),
    )
    return judge_decisions(case, "straight through", decisions)


def of_kind(case: Case, b: Bends, kind: str) -> tuple[Bends, int]:
    """The events on shapes of a kind that are sure, and how many there are in all."""
    b = b.part(case.bench.truth.kind[b.steps.shape] == kind)
    return b.part(b.sure), len(b.sure)


def compare_mirror(case: Case, kind: str) -> Outcome:
    """Directions after a mirror, in eps (1 + 2 S / r); Mitsuba's at the same, rounded, normal: in eps."""
    b, met = of_kind(case, bends(case, refracts=False), kind)
    d, n, _ = b.asked()
    theirs, asked = optics.mirrored(d, n), extended.mirror(extended.unit(d), extended.unit(n))
    unit = 1 + 2 * b.curve
    return _judge(case, f"mirror, {kind}", "mirror", b, theirs, asked, unit, np.ones(len(unit)), met)


def compare_refraction(case: Case, kind: str) -> Outcome:
    """Directions after refraction in units of their conditioning, see the table of tolerances; where
    reflection is not total, nor nearly."""
    b, met = of_kind(case, bends(case, refracts=True), kind)
    total = b.k <= total_band(b, SINGLE)
    b, met = b.part(~total), met - int((b.k < 0).sum())
    d, n, outward = b.asked()
    theirs, _ = optics.refracted(d, outward, case.bench.truth.ior[b.steps.shape])
    asked = extended.refract(extended.unit(d), extended.unit(n), extended.number(b.eta))[0]
    root, c = np.sqrt(b.k), np.abs((b.normal * b.steps.d).sum(axis=1))
    same_normal = 1 + (b.eta + b.eta**2) / root
    unit = same_normal + b.curve * np.abs(b.eta * c - root) * (1 + b.eta / root)
    return _judge(case, f"refraction, {kind}", "refraction", b, theirs, asked, unit, same_normal, met)


def _judge(
    case: Case,
    term: str,
    name: str,
    b: Bends,
    theirs: Array,
    asked: extended.Extended,
    unit: Array,
    same_normal: Array,
    met: int,
) -> Outcome:
    """Both sides against their own closed form; `unit`, `same_normal`: conditioning of ours and of theirs;
    `met`: events in all, those left out among them."""
    ours_error, theirs_error = b.steps.out - b.exact, theirs - extended.double(asked)
    difference, ours, mitsuba = (
        np.abs(e).max(axis=1, initial=0) for e in (ours_error - theirs_error, ours_error, theirs_error)
    )
    numbers = Numbers(
        rays=b.steps.rays,
        index=np.arange(len(ours)),
        difference=difference / (SINGLE * unit),
        ours=ours / (case.epsilon * unit),
        mitsuba=mitsuba / (SINGLE * same_normal),
        unit=TOLERANCES[name].unit,
        answers=lambda i: (
            f"leaves {b.steps.p[i].tolist()} along {b.steps.out[i]}",
            f"along {theirs[i]} at the rounded normal {b.asked()[1][i].tolist()}",
            f"along {b.exact[i]}",
        ),
        ulp=(case.ulps(ours), case.bench.ulps(mitsuba)),
        left_out=met - len(ours),
    )
    return judge_numbers(case, term, numbers, bounds(case, name, "mitsuba direction"))


def has_glass(kind: str, scene: tracer.Scene) -> bool:
    """Whether shapes of that kind refract."""
    return kind in glass_kinds(scene)


def terms() -> list[Term]:
    """Mirror and refraction by kind of shape, and index 1."""
    return [
        Term("straight through", "direction after index 1", has_shapes, compare_straight),
        *by_kind("mirror", "direction after a mirror", compare_mirror),
        *by_kind("refraction", "direction after refraction", compare_refraction, has_glass),
    ]
