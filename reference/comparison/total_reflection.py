"""The term of total reflection: which refractions are total."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reference.comparison import optics
from reference.comparison.bends import bends, total_band
from reference.comparison.case import Case
from reference.comparison.decisions import Decisions, judge_decisions
from reference.comparison.judge import SINGLE
from reference.comparison.kinds import glass_kinds
from reference.comparison.records import Outcome, Term


def compare_total_reflection(case: Case) -> Outcome:
    """Which refractions are total: ours, Mitsuba's and the sign of k."""
    b = bends(case, refracts=True)
    left_out = int((~b.sure).sum())
    b = b.part(b.sure)
    d, _, outward = b.asked()
    _, theirs = optics.refracted(d, outward, case.bench.truth.ior[b.steps.shape])
    ours, exact = np.isnan(b.steps.out).any(axis=1), b.k < 0
    # Each side is doubtful within the rounding of its own precision only.
    ours_wrong = (ours != exact) & (np.abs(b.k) > total_band(b, case.epsilon))
    theirs_wrong = (theirs != exact) & (np.abs(b.k) > total_band(b, SINGLE))
    words = {True: "total", False: "refracts"}
    decisions = Decisions(
        rays=b.steps.rays,
        differ=(ours != theirs) | ours_wrong | theirs_wrong,
        in_band=lambda k: ~(ours_wrong | theirs_wrong)[k],
        wrong=lambda k: (ours_wrong[k], theirs_wrong[k]),
        answers=lambda k: (words[bool(ours[k])], words[bool(theirs[k])], words[bool(exact[k])]),
    )
    outcome = judge_decisions(case, "total reflection", decisions)
    return replace(outcome, figures={"events left out": float(left_out)})


def terms() -> list[Term]:
    """The one term."""
    return [
        Term(
            "total reflection",
            "where refraction is total",
            lambda scene: bool(glass_kinds(scene)),
            compare_total_reflection,
        )
    ]
