"""One row a term, over all scenes and both precisions."""

from __future__ import annotations

from dataclasses import dataclass

from reference.comparison.records import Outcome
from reference.report.bounds import MITSUBA, OURS, Bound, bounds_of, failures_first, used


@dataclass(frozen=True)
class TermRow:
    """`worst` is the outcome that failed or uses most of its allowance; the errors are the largest of any
    scene (None: no closed form), each with its bound; `rays` and `grazing` are sums."""

    term: str
    worst: Outcome
    scenes: int
    rays: int
    grazing: int
    failed: int
    single: Bound | None
    double: Bound | None
    mitsuba: Bound | None


def term_rows(outcomes: tuple[Outcome, ...]) -> list[TermRow]:
    """The rows, failures first, then by how much is used."""
    groups: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        groups.setdefault(outcome.term, []).append(outcome)
    rows = [_row(term, group) for term, group in groups.items()]
    return sorted(rows, key=lambda row: (row.worst.passed, -used(row.worst)))


def _row(term: str, group: list[Outcome]) -> TermRow:
    return TermRow(
        term=term,
        worst=failures_first(group)[0],
        scenes=len({outcome.scene for outcome in group}),
        rays=sum(outcome.rays for outcome in group),
        grazing=sum(outcome.excluded for outcome in group),
        failed=sum(not outcome.passed for outcome in group),
        single=_largest(group, OURS, ("single",)),
        double=_largest(group, OURS, ("double",)),
        mitsuba=_largest(group, MITSUBA, ("single", "double")),
    )


def _largest(group: list[Outcome], name: str, precisions: tuple[str, ...]) -> Bound | None:
    found = [
        bound
        for outcome in group
        if outcome.precision in precisions
        for bound in bounds_of(outcome)
        if bound.name == name
    ]
    return max(found, key=lambda bound: bound.used, default=None)
