"""The report to look at: one HTML file with everything in it."""

from __future__ import annotations

import os

from reference.comparison.records import Validation
from reference.comparison.run import terms as all_terms
from reference.report import bounds, look
from reference.report.header import COMMAND
from reference.report.headline import Headline
from reference.report.matrix import CLASSES, matrix
from reference.report.pictures import bar, viridis_bar
from reference.report.sections import Section, sections_of
from reference.report.summary import term_rows
from reference.tolerances import TOLERANCES
from tracer.film.atomic import atomic_write


def write_report(path: str | os.PathLike[str], validation: Validation) -> None:
    """The page; it loads nothing, neither from the network nor from files beside it. Raises OutputError."""
    text = page(validation)
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def page(validation: Validation) -> str:
    """The text of the page."""
    environment = look.environment(look.TEMPLATES)
    environment.filters["used"] = bounds.used
    environment.filters["broken"] = bounds.broken
    sections = sections_of(validation.outcomes)
    terms, rows = matrix(validation.outcomes)
    return environment.get_template("page.html.j2").render(
        validation=validation,
        facts={name: value for name, value in validation.header.items() if name != COMMAND},
        command=validation.header.get(COMMAND, ""),
        headline=Headline.of(validation),
        summary=term_rows(validation.outcomes),
        outcomes=bounds.failures_first(validation.outcomes),
        terms=terms,
        compares={term.name: term.compares for term in all_terms()},
        rows=rows,
        shades=CLASSES,
        sections=sections,
        anchors={section.scene: section.anchor for section in sections},
        opened=_opened(sections),
        tolerances=TOLERANCES,
        bar=bar(),
        depth_bar=viridis_bar(),
        css=look.css(),
        script=look.script(),
    )


def _opened(sections: list[Section]) -> set[str]:
    """Anchors of the scenes that are open from the start: those with failures, or else the first."""
    failing = {section.anchor for section in sections if section.failed}
    return failing or {section.anchor for section in sections[:1]}
