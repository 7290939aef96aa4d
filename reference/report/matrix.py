"""Scenes by terms: how much of its allowance the worst precision of each uses."""

from __future__ import annotations

from dataclasses import dataclass
from math import isinf, log10

from reference.comparison.records import Outcome
from reference.report.bounds import failures_first, tightest, used
from reference.report.numbers import number, percent, unit

DECADES = 3
"""The scale of the colors begins at a thousandth of what is allowed."""
CLASSES = 10
"""Shades of the scale."""


@dataclass(frozen=True)
class Cell:
    """One square: `shade` from 0 to CLASSES, `text` in it (percent; empty: no ray met the term), `says` what
    is under it."""

    shade: int
    passed: bool
    text: str
    says: str


def matrix(outcomes: tuple[Outcome, ...]) -> tuple[list[str], dict[str, list[Cell | None]]]:
    """The terms, and a row a scene; None where a term does not apply."""
    terms = _in_order(outcomes)
    groups: dict[str, dict[str, list[Outcome]]] = {}
    for outcome in outcomes:
        groups.setdefault(outcome.scene, {}).setdefault(outcome.term, []).append(outcome)
    rows = {
        scene: [_cell(failures_first(found[term])[0]) if term in found else None for term in terms]
        for scene, found in groups.items()
    }
    return terms, rows


def _in_order(outcomes: tuple[Outcome, ...]) -> list[str]:
    """All terms; one that the first scenes lack stands where it stands in its own scene."""
    terms: list[str] = []
    before = ("", "")
    for outcome in outcomes:
        if outcome.term not in terms:
            scene, term = before
            place = terms.index(term) + 1 if scene == outcome.scene and term else 0
            terms.insert(place, outcome.term)
        before = (outcome.scene, outcome.term)
    return terms


def shade(share: float) -> int:
    """The shade of a share of an allowance, by its logarithm; 0 for nothing at all."""
    if share <= 0:
        return 0
    place = 1 + (log10(min(share, 1)) + DECADES) / DECADES * (CLASSES - 1)
    return max(1, round(place))


def _cell(worst: Outcome) -> Cell:
    share, bound = used(worst), tightest(worst)
    if not worst.rays and worst.passed:
        return Cell(0, True, "", f"{worst.term}, {worst.scene}: no ray met it")
    if worst.passed:
        text = "0" if not share else "<1" if share < 0.01 else f"{100 * share:.0f}"
    else:
        text = number(bound.measured) if isinf(share) else f"{share:.1f}"
    allowed = f"{number(bound.measured)} of {number(bound.allowed)} allowed"
    what = f"{bound.name} {allowed}" + ("" if bound.name == "grazing rays" else f" {unit(worst.unit)}")
    guilty = f", guilty: {worst.guilty}" if worst.guilty else ""
    says = (
        f"{worst.term}, {worst.scene}, {worst.precision}: {worst.verdict}; {what} ({percent(share)}){guilty}"
    )
    return Cell(shade(share), worst.passed, text, says)
