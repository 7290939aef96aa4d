"""The run in Markdown: a summary that is kept with the sources, and the headline in another file."""

from __future__ import annotations

import os
from pathlib import Path

from reference.comparison.records import Validation
from reference.report.bounds import Bound
from reference.report.header import COMMAND
from reference.report.headline import Headline, Peak
from reference.report.numbers import NOTHING, number, times, unit
from reference.report.summary import TermRow, term_rows
from tracer.errors import UsageError
from tracer.film.atomic import atomic_write

BEGIN, END = "<!-- crossvalidation:begin -->", "<!-- crossvalidation:end -->"
COLUMNS = (
    "term", "verdict", "scenes", "worst scene", "rays", "measured", "allowed", "unit", "margin",
    "our error, single", "our error, double", "Mitsuba's error", "grazing rays",
)  # fmt: skip


def summary_markdown(validation: Validation) -> str:
    """Headline, a row a term, what was left out, with what it was made, and the command that repeats it."""
    facts = {name: value for name, value in validation.header.items() if name != COMMAND}
    lines = ["# Cross-validation against Mitsuba 3", "", *headline_lines(validation), "", "## Terms", ""]
    lines += [_line(COLUMNS), _line(["---"] * len(COLUMNS))]
    lines += [_line(_cells(row)) for row in term_rows(validation.outcomes)]
    lines += [
        "",
        "Measured is the largest difference between the two tracers, of the scene that uses most of its "
        "allowance; errors are the largest of all scenes against extended precision, with what is allowed, "
        "ours in units of our precision. Rays are summed over scenes and precisions.",
    ]
    if validation.notes:
        lines += ["", "## What was left out", "", *(f"- {_plain(note)}" for note in validation.notes)]
    lines += ["", "## With what it was made", "", _line(["what", "value"]), _line(["---", "---"])]
    lines += [_line(fact) for fact in facts.items()]
    if COMMAND in validation.header:
        lines += ["", f"To repeat it:\n\n    {validation.header[COMMAND]}"]
    return "\n".join(lines) + "\n"


def headline_lines(validation: Validation) -> list[str]:
    """Bullets with the numbers that matter."""
    line = Headline.of(validation)
    if not line.outcomes:
        return ["- Nothing was compared."]
    verdict = f"{number(line.failed)} failed" if line.failed else "all passed"
    lines = [
        f"- {number(line.outcomes)} comparisons, {number(line.terms)} terms on {number(line.scenes)} "
        f"scenes: **{verdict}**{_nearest(line.nearest)}.",
        f"- {number(line.questions)} questions what a ray hits or sees, each asked of both tracers: "
        f"**{number(line.outside)}** answers differ outside the grazing band, {number(line.inside)} inside.",
    ]
    errors = {
        "ours in single precision": line.ours["single"],
        "ours in double precision": line.ours["double"],
        "Mitsuba's": line.mitsuba,
    }
    shown = [f"{name} {_peak(found)}" for name, found in errors.items() if found]
    return [*lines, f"- Largest errors against extended precision: {'; '.join(shown)}."] if shown else lines


def headline_place(path: str | os.PathLike[str]) -> tuple[str, str]:
    """The text of a Markdown file before and after its headline, the markers included. Raises UsageError
    where a marker is missing or the file cannot be read."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not UTF-8"
        raise UsageError(f"{os.fspath(path)}: cannot be read: {reason}") from error
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    for marker, found in ((BEGIN, begin), (END, end)):
        if not found:
            place = "" if marker == BEGIN else f" after {BEGIN}"
            raise UsageError(
                f'{os.fspath(path)}: the marker "{marker}" is missing{place}; the headline goes between '
                f"{BEGIN} and {END}"
            )
    return before + begin, end + after


def rewrite_headline(path: str | os.PathLike[str], validation: Validation) -> None:
    """Puts the headline between the two markers of a Markdown file. Raises UsageError as `headline_place`,
    OutputError where the file cannot be written."""
    before, after = headline_place(path)
    block = "\n".join(headline_lines(validation))
    with atomic_write(path) as temporary:
        temporary.write_text(f"{before}\n{block}\n{after}", encoding="utf-8")


def _cells(row: TermRow) -> list[str]:
    worst = row.worst
    over = worst.excluded > worst.excluded_allowed
    return [
        row.term,
        _verdict(row),
        number(row.scenes),
        worst.scene,
        number(row.rays),
        number(worst.measured),
        number(worst.allowed),
        unit(worst.unit),
        times(worst.margin),
        *(_error(bound) for bound in (row.single, row.double, row.mitsuba)),
        number(row.grazing) + (f" (here {worst.excluded} of {worst.excluded_allowed})" if over else ""),
    ]


def _verdict(row: TermRow) -> str:
    if row.worst.passed:
        return "passed" if row.rays else "no rays"
    return f"**{row.failed} failed**" + (f" ({row.worst.guilty})" if row.worst.guilty else "")


def _error(bound: Bound | None) -> str:
    return NOTHING if bound is None else f"{number(bound.measured)} of {number(bound.allowed)}"


def _nearest(found: Peak | None) -> str:
    if found is None:
        return ""
    return f"; lowest margin {times(found.margin)} ({found.bound.name}, {found.term}, {_plain(found.scene)})"


def _peak(found: Peak) -> str:
    share = f"{number(found.bound.measured)} of {number(found.bound.allowed)} {unit(found.unit)}"
    return f"{share} ({found.term}, {_plain(found.scene)})"


def _line(cells: list[str] | tuple[str, ...]) -> str:
    return "| " + " | ".join(_plain(cell) for cell in cells) + " |"


def _plain(text: str) -> str:
    """Text that is no markup in a cell: lines, bars and tags are what a scene's name could break."""
    return " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;")
