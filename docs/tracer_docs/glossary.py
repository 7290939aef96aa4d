"""`{document-rows} lproperty rate s`: rows of the table of names in model.md, with links to the objects;
with `:rest:` those that no earlier table of the page has shown.

The table in model.md is the one source; here each name leads to its description in the API pages, to the
public one where there is one.
"""

from __future__ import annotations

import importlib
import inspect
import re
from pathlib import Path
from typing import cast

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.logging import getLogger

import tracer

MODEL = Path(__file__).resolve().parents[1] / "model.md"
CODE = re.compile(r"`([^`]+)`")
FIRST_NAME = re.compile(r"[\w.]+")
SHOWN_KEY = "tracer_document_rows"


def table_of_names() -> list[tuple[str, str, list[str]]]:
    """(the document's name, what it is, our dotted names) from the first section of model.md."""
    section = MODEL.read_text(encoding="utf-8").partition("\n## 1. ")[2].partition("\n## ")[0]
    rows = [line for line in section.splitlines() if line.startswith("| ")][1:]
    cells = [[cell.strip() for cell in re.split(r"(?<!\\)\|", row)[1:-1]] for row in rows]
    return [(row[0], row[1].replace("\\|", "|"), CODE.findall(row[2])) for row in cells]


def described_name(dotted: str) -> str:
    """Where an object is described: `tracer.Result.depth` for tracer.film.result.Result.depth."""
    parts = dotted.split(".")
    for length in range(len(parts) - 1, 0, -1):
        try:
            module = importlib.import_module(".".join(parts[:length]))
        except ModuleNotFoundError:
            continue
        name, rest = parts[length], parts[length + 1 :]
        found = getattr(module, name, None)
        if name in tracer.__all__ and found is getattr(tracer, name):
            return ".".join(["tracer", name, *rest])
        if rest and inspect.isclass(found):  # a field is described where it is declared first
            owners = [base for base in found.__mro__ if rest[0] in base.__dict__.get("__annotations__", {})]
            found = owners[-1] if owners else found
            return ".".join([found.__module__, found.__qualname__, *rest])
        return dotted
    return dotted


def short_name(dotted: str) -> str:
    """The name without the modules: `Stripes.colors`, `texture_color`."""
    parts = dotted.split(".")
    first = next((k for k, part in enumerate(parts) if part[0].isupper()), len(parts) - 1)
    return ".".join(parts[first:])


class DocumentRows(SphinxDirective):
    """A table of the rows whose first name is one of the arguments."""

    optional_arguments = 100
    option_spec = {"rest": directives.flag}

    def run(self) -> list[nodes.Node]:
        self.env.note_dependency(str(MODEL))
        shown: set[int] = cast("set[int]", self.env.temp_data.setdefault(SHOWN_KEY, set()))
        rows = table_of_names()
        names = [FIRST_NAME.findall(row[0])[0] for row in rows]
        chosen = [k for k, name in enumerate(names) if name in self.arguments]
        absent = [name for name in self.arguments if name not in names]
        if absent:
            raise self.error(f"model.md has no row for {absent[0]!r}")
        if "rest" in self.options:
            chosen = [k for k in range(len(rows)) if k not in shown]
        shown.update(chosen)
        return [self._table([rows[k] for k in chosen])]

    def _table(self, rows: list[tuple[str, str, list[str]]]) -> nodes.table:
        group = nodes.tgroup("", cols=3)
        group += [nodes.colspec("", colwidth=width) for width in (26, 34, 40)]
        head = nodes.thead(
            "", _row(*(nodes.paragraph("", title) for title in ("report", "what it is", "here")))
        )
        body = nodes.tbody("")
        for theirs, meaning, ours in rows:
            body += _row(_with_code(theirs), nodes.paragraph("", meaning), self._links(ours))
        group += [head, body]
        return nodes.table("", group, classes=["document-rows"])

    def _links(self, names: list[str]) -> nodes.paragraph:
        paragraph = nodes.paragraph()
        for number, name in enumerate(names):
            if number:
                paragraph += nodes.Text(", ")
            target = described_name(name)
            reference = addnodes.pending_xref(
                "",
                nodes.literal("", short_name(target), classes=["xref", "py"]),
                refdomain="py",
                reftype="obj",
                reftarget=target,
                refdoc=self.env.docname,
                refexplicit=True,
                refwarn=True,
            )
            paragraph += reference
        return paragraph


def _row(*cells: nodes.Node) -> nodes.row:
    return nodes.row("", *(nodes.entry("", cell) for cell in cells))


def _with_code(text: str) -> nodes.paragraph:
    parts = CODE.split(text)
    return nodes.paragraph(
        "", "", *(nodes.literal("", part) if k % 2 else nodes.Text(part) for k, part in enumerate(parts))
    )


def check_completeness(app: Sphinx, doctree: nodes.document) -> None:
    """A warning, and so a failure, where a page shows some of the names and forgets others."""
    shown = app.env.temp_data.get(SHOWN_KEY)
    if shown is not None:
        left = [row[0] for k, row in enumerate(table_of_names()) if k not in shown]
        if left:
            getLogger(__name__).warning(
                "names of the report without a row: %s", left, location=app.env.docname
            )


def setup(app: Sphinx) -> dict[str, bool]:
    """Registers the directive."""
    app.add_directive("document-rows", DocumentRows)
    app.connect("doctree-read", check_completeness)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
