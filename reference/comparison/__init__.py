"""The comparison with Mitsuba and with closed forms, shared by `tracer validate` and pytest."""

from __future__ import annotations

from reference.comparison.case import Case
from reference.comparison.records import Growth, Outcome, Replay, Term, Validation
from reference.comparison.run import Progress, find_terms, run
from reference.comparison.run import terms as all_terms

__all__ = [
    "Case",
    "Growth",
    "Outcome",
    "Progress",
    "Replay",
    "Term",
    "Validation",
    "all_terms",
    "find_terms",
    "run",
]
