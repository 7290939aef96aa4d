"""The few numbers that say how a run went."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from reference.comparison.records import Outcome, Validation
from reference.report.bounds import DIFFERENCE, MITSUBA, OURS, RAYS, Bound, bounds_of

QUESTIONS = ("hits", "depth buffer, mask", "lockstep, next hit", "visibility")
"""Terms that ask what a ray hits, or whether it is blocked. The same rays are asked in both precisions: each
time is a question of its own, since our answer is computed anew."""


@dataclass(frozen=True)
class Peak:
    """The number of an outcome that uses most of its allowance, and where it was found."""

    bound: Bound
    unit: str
    term: str
    scene: str
    precision: str

    @property
    def margin(self) -> float:
        """How many times the number fits into what is allowed."""
        return 1 / self.bound.used if self.bound.used else float("inf")


@dataclass(frozen=True)
class Headline:
    """What was compared, leaving out terms that no ray of a scene met: `questions` with their answers that
    differ `outside` and `inside` the grazing band; the largest errors of each side against extended
    precision, and the number of all that is `nearest` to its bound (None: there is none)."""

    scenes: int
    terms: int
    outcomes: int
    failed: int
    questions: int
    outside: int
    inside: int
    ours: dict[str, Peak | None]
    mitsuba: Peak | None
    nearest: Peak | None

    @staticmethod
    def of(validation: Validation) -> Headline:
        """The numbers of a run."""
        outcomes = [outcome for outcome in validation.outcomes if outcome.rays or not outcome.passed]
        asked = [outcome for outcome in outcomes if outcome.term in QUESTIONS]
        return Headline(
            scenes=len({outcome.scene for outcome in outcomes}),
            terms=len({outcome.term for outcome in outcomes}),
            outcomes=len(outcomes),
            failed=sum(not outcome.passed for outcome in outcomes),
            questions=sum(outcome.rays for outcome in asked),
            outside=int(sum(outcome.measured for outcome in asked)),
            inside=sum(outcome.excluded for outcome in asked),
            ours={
                precision: peak((o for o in outcomes if o.precision == precision), (OURS,))
                for precision in ("single", "double")
            },
            mitsuba=peak(outcomes, (MITSUBA,)),
            nearest=peak(outcomes, (DIFFERENCE, OURS, MITSUBA)),
        )


def peak(outcomes: Iterable[Outcome], names: tuple[str, ...]) -> Peak | None:
    """The bound of one of these names that is used most, among those that allow a number other than 0."""
    found = [
        Peak(bound, outcome.unit, outcome.term, outcome.scene, outcome.precision)
        for outcome in outcomes
        if outcome.unit != RAYS
        for bound in bounds_of(outcome)
        if bound.name in names
    ]
    return max(found, key=lambda entry: entry.bound.used, default=None)
