"""How much of what is allowed an outcome uses, bound by bound."""

from __future__ import annotations

from dataclasses import dataclass
from math import isnan

from reference.comparison.records import Outcome

DIFFERENCE, OURS, MITSUBA, GRAZING = "difference", "our error", "Mitsuba's error", "grazing rays"
RAYS = "rays"
"""The unit of terms that count rays."""


@dataclass(frozen=True)
class Bound:
    """A number that must not exceed another one; `name` is one of the four above."""

    name: str
    measured: float
    allowed: float

    @property
    def used(self) -> float:
        """The share of the allowance, above 1 where it is broken; infinite where nothing is allowed."""
        if isnan(self.measured):
            return float("inf")
        if self.measured == 0:
            return 0.0
        return self.measured / self.allowed if self.allowed else float("inf")


def bounds_of(outcome: Outcome) -> list[Bound]:
    """The bounds that an outcome has to keep; errors without a closed form have none."""
    found = [
        Bound(DIFFERENCE, outcome.measured, outcome.allowed),
        Bound(GRAZING, outcome.excluded, outcome.excluded_allowed),
    ]
    errors = (
        (OURS, outcome.ours_error, outcome.ours_allowed),
        (MITSUBA, outcome.mitsuba_error, outcome.mitsuba_allowed),
    )
    return found + [Bound(*error) for error in errors if not isnan(error[1]) and not isnan(error[2])]


def broken(outcome: Outcome) -> list[Bound]:
    """The bounds that do not hold; none where the outcome passed."""
    return [bound for bound in bounds_of(outcome) if bound.used > 1]


def tightest(outcome: Outcome) -> Bound:
    """The bound that is broken worst, or nearest to it."""
    return max(bounds_of(outcome), key=lambda bound: bound.used)


def used(outcome: Outcome) -> float:
    """The largest share of an allowance; the outcome passed where it is at most 1."""
    return tightest(outcome).used


def failures_first(outcomes: tuple[Outcome, ...] | list[Outcome]) -> list[Outcome]:
    """What failed, then what uses most of its allowance; else in the order of the run."""
    return sorted(outcomes, key=lambda outcome: (outcome.passed, -used(outcome)))
