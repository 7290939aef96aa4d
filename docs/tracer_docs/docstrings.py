"""Docstrings of this project are plain text with `code`; this makes reStructuredText of them.

Fields of records carry their explanation in `Field(description=...)`, from which the scene reference is made;
it becomes the docstring of the attribute.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer
from sphinx.transforms.post_transforms import SphinxPostTransform
from sphinx.util.nodes import find_pending_xref_condition

from tracer.lights import LIGHT_KINDS
from tracer.records import Record
from tracer.scene import Scene
from tracer.shapes import SHAPE_KINDS
from tracer.textures import TEXTURE_KINDS

CODE = re.compile(r"(`[^`]+`)")
DATA = ("attribute", "data", "property")
HIDDEN_COLON = "\N{MODIFIER LETTER COLON}"  # napoleon takes what stands before a colon for a type
ALIAS = re.compile(r"TypeAliasForwardRef\('(\w+)'\)")  # what autodoc_type_aliases leaves in a union
BULLET = re.compile(r"\s*(?:\* )?")
SPECIAL = re.compile(r"[*|]|(?<=\w)_(?!\w)")


def as_restructured_text(line: str) -> str:
    """Quote what reStructuredText would read as markup: * and |, and _ at the end of a word."""
    bullet = BULLET.match(line)
    start = bullet[0] if bullet else ""
    parts = CODE.split(line[len(start) :])
    return start + "".join(part if CODE.fullmatch(part) else SPECIAL.sub(r"\\\g<0>", part) for part in parts)


def _before_napoleon(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    lines[:] = [as_restructured_text(line) for line in lines]
    if what in DATA:
        lines[:] = [line.replace(":", HIDDEN_COLON) for line in lines]


def _after_napoleon(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    if what in DATA:
        lines[:] = [line.replace(HIDDEN_COLON, ":") for line in lines]


def records() -> Iterator[type[Record]]:
    """All records of the package."""
    waiting: list[type[Record]] = [
        Scene,
        *SHAPE_KINDS.values(),
        *LIGHT_KINDS.values(),
        *TEXTURE_KINDS.values(),
    ]
    waiting += Record.__subclasses__()
    seen: set[type[Record]] = set()
    while waiting:
        record = waiting.pop()
        if record not in seen:
            seen.add(record)
            yield record
            waiting += record.__subclasses__()


def _explain_fields(app: Sphinx) -> None:
    """Let autodoc find the description of a field where it looks for a text below the field."""
    for record in records():
        analyzer = ModuleAnalyzer.for_module(record.__module__)
        analyzer.analyze()
        for name in record.__dict__.get("__annotations__", {}):
            if name in record.model_fields:
                text = record.model_fields[name].description or ""
                analyzer.attr_docs[record.__qualname__, name] = [text, ""]


def _shorten_fields(app: Sphinx, doctree: nodes.document) -> None:
    """Leave out the types of fields: they are checks for pydantic; the scene reference has them in words."""
    names = {record.__qualname__ for record in records()}
    for signature in doctree.findall(addnodes.desc_signature):
        owner, _, field = (signature.get("fullname") or "").rpartition(".")
        if owner in names and signature.parent.get("objtype") == "attribute":
            for node in list(signature.findall(addnodes.desc_annotation)):
                signature.remove(node)


def _leave_out(app: Sphinx, what: str, name: str, obj: Any, skip: bool, options: Any) -> bool | None:
    """What pydantic itself adds to a record."""
    return True if name in ("model_config", "model_post_init") else None


class TypesOfSignatures(SphinxPostTransform):
    """A type in a signature is a link where this site describes exactly one object of that name, else text.

    Aliases, and types of other projects, whose inventories would have to come over the network, have no page
    here. Links in the text are not touched: those have to resolve.
    """

    default_priority = 1

    def run(self, **kwargs: Any) -> None:
        objects = self.env.domaindata["py"]["objects"]
        classes = {name for name, entry in objects.items() if entry.objtype in ("class", "exception")}
        for node in list(self.document.findall(addnodes.pending_xref)):
            if node.get("refdomain") != "py" or "refwarn" in node:
                continue
            target = node["reftarget"]
            names = (target, f"{node.get('py:module')}.{target}")
            exact = sum(name in classes for name in names)
            if not exact and sum(name.endswith("." + target) for name in classes) != 1:
                short = find_pending_xref_condition(node, "resolved")
                node.replace_self((short or node).children)


def _signature(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, signature: str | None, returns: str | None
) -> tuple[str, str | None] | None:
    """Records are built from keys, which the attributes list; aliases keep their names."""
    if what == "class" and isinstance(obj, type) and issubclass(obj, Record):
        return "(**keys)", None
    if signature and ALIAS.search(signature):
        return ALIAS.sub(r"\1", signature), returns
    return None


def setup(app: Sphinx) -> dict[str, bool]:
    """Registers what runs before and after napoleon, which reads the sections of the docstrings."""
    app.connect("autodoc-process-docstring", _before_napoleon, priority=400)
    app.connect("autodoc-process-docstring", _after_napoleon, priority=600)
    app.add_post_transform(TypesOfSignatures)
    app.connect("autodoc-process-signature", _signature)
    app.connect("autodoc-skip-member", _leave_out)
    app.connect("builder-inited", _explain_fields)
    app.connect("doctree-read", _shorten_fields)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
