"""`{all-commands}`: the help of every command, as the command line itself prints it."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from tracer.cli.app import cli

COLUMNS = 88


def help_of(*names: str) -> str:
    """What `tracer --help` prints, or `tracer NAME --help`."""
    width: dict[str, Any] = {"terminal_width": COLUMNS, "max_content_width": COLUMNS}
    context = cli.make_context("tracer", [], resilient_parsing=True, **width)
    for name in names:
        context = cli.commands[name].make_context(name, [], parent=context, resilient_parsing=True, **width)
    return context.get_help()


class AllCommands(SphinxDirective):
    """A section for `tracer` and for each of its commands, in the order of `tracer --help`."""

    def run(self) -> list[nodes.Node]:
        sections = [self._section("tracer", help_of())]
        return sections + [self._section(f"tracer {name}", help_of(name)) for name in sorted(cli.commands)]

    def _section(self, name: str, text: str) -> nodes.section:
        section = nodes.section(ids=[name.replace(" ", "-")], names=[name])
        section += nodes.title("", "", nodes.literal("", name))
        section += nodes.literal_block("", text, language="text")
        return section


def setup(app: Sphinx) -> dict[str, bool]:
    """Registers the directive."""
    app.add_directive("all-commands", AllCommands)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
