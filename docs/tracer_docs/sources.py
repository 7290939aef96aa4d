"""Links from a page to files of the repository: modules lead to their API page, other files to their text.

A link such as [ray.py](../tracer/ray.py) works where the repository is browsed. On the site it leads to
the section of that module, or to a page with the file, highlighted. Each object of the API pages has a
link to its lines there.
"""

from __future__ import annotations

import html
import importlib
import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docutils import nodes
from pygments.lexers import get_lexer_for_filename
from pygments.util import ClassNotFound
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.transforms import SphinxTransform

ROOT = Path(__file__).resolve().parents[2]
FOLDER = "source"
LINE = "line"


class LinksToFiles(SphinxTransform):
    """Downloads that MyST makes of links to files become references to modules, else to files."""

    default_priority = 200

    def apply(self, **kwargs: Any) -> None:
        for node in list(self.document.findall(addnodes.download_reference)):
            _, path = self.env.relfn2path(node["reftarget"], self.env.docname)
            file = Path(path).resolve()
            if file.is_file() and file.is_relative_to(ROOT):
                reference = addnodes.pending_xref(
                    "",
                    refdomain="py",
                    reftype="mod",
                    reftarget=module_name(file),
                    refdoc=self.env.docname,
                    refexplicit=True,
                    refwarn=True,
                    source_page=source_page(self.env, file),
                )
                reference += node.children
                node.replace_self(reference)


def module_name(file: Path) -> str:
    """`tracer.ray` for tracer/ray.py; what is no module has a name that no module has."""
    path = file.relative_to(ROOT)
    if path.suffix != ".py":
        return path.as_posix()
    return ".".join(path.with_suffix("").parts).removesuffix(".__init__")


def source_page(env: BuildEnvironment, file: Path) -> str:
    """The name of the page that shows a file, which from now on is needed."""
    name = file.relative_to(ROOT).as_posix()
    _shown_files(env).setdefault(env.docname, set()).add(name)
    return f"{FOLDER}/{name}"


def _shown_files(env: BuildEnvironment) -> dict[str, set[str]]:
    """The files that each document needs a page of."""
    if not hasattr(env, "tracer_shown_files"):
        env.tracer_shown_files = {}
    return env.tracer_shown_files


def _forget(app: Sphinx, env: BuildEnvironment, docname: str) -> None:
    _shown_files(env).pop(docname, None)


def _to_file(
    app: Sphinx, env: BuildEnvironment, node: addnodes.pending_xref, content: nodes.TextElement
) -> nodes.reference | None:
    """What is no documented module is a file."""
    if "source_page" not in node:
        return None
    uri = app.builder.get_relative_uri(node["refdoc"], node["source_page"])
    return nodes.reference("", "", content, internal=True, refuri=uri)


def _link_objects(app: Sphinx, doctree: nodes.document) -> None:
    """Put a link to its lines behind each class and function."""
    for signature in doctree.findall(addnodes.desc_signature):
        found = place_of(signature.get("module"), signature.get("fullname"))
        if found is None:
            continue
        page = source_page(app.env, found[0])
        uri = f"{app.builder.get_relative_uri(app.env.docname, page)}#{LINE}-{found[1]}"
        text = nodes.inline("", "[source]", classes=["viewcode-link"])
        signature += nodes.reference("", "", text, internal=True, refuri=uri)


def place_of(module: str | None, fullname: str | None) -> tuple[Path, int] | None:
    """File and first line of an object; None for what has no lines of its own, such as a field."""
    if not module or not fullname:
        return None
    found: Any = importlib.import_module(module)
    for name in fullname.split("."):
        found = getattr(found, name, None)
    if isinstance(found, property):
        found = found.fget
    try:
        found = inspect.unwrap(found)
        file, (_, line) = Path(inspect.getsourcefile(found) or "").resolve(), inspect.getsourcelines(found)
    except (TypeError, OSError):
        return None
    return (file, max(1, line)) if file.is_relative_to(ROOT) and file.suffix == ".py" else None


def _pages(app: Sphinx) -> Iterator[tuple[str, dict[str, Any], str]]:
    """A page for each file that is needed."""
    for name in sorted({name for names in _shown_files(app.env).values() for name in names}):
        text = (ROOT / name).read_text(encoding="utf-8")
        try:
            language = get_lexer_for_filename(name).aliases[0]
        except ClassNotFound:
            language = "text"
        code = app.builder.highlighter.highlight_block(text, language, lineanchors=LINE)
        title = html.escape(name)
        body = f"<h1><code>{title}</code></h1>\n{code}"
        yield f"{FOLDER}/{name}", {"title": name, "body": body}, "page.html"


def _navigate_quickly(
    app: Sphinx, pagename: str, templatename: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """The navigation of these pages is the same for all of one depth, and takes longer than all the rest."""
    if pagename.startswith(f"{FOLDER}/"):
        compute, depth = context["toctree"], pagename.count("/")

        def navigation(**options: Any) -> str:
            key = depth, tuple(sorted(options.items()))
            if key not in _NAVIGATION:
                _NAVIGATION[key] = compute(**options)
            return _NAVIGATION[key]

        context["toctree"] = navigation


_NAVIGATION: dict[tuple[Any, ...], str] = {}


def setup(app: Sphinx) -> dict[str, bool]:
    """Registers the transform, the fallback, the links of the API pages, and the pages."""
    app.add_transform(LinksToFiles)
    app.connect("env-purge-doc", _forget)
    app.connect("doctree-read", _link_objects)
    app.connect("missing-reference", _to_file)
    app.connect("html-collect-pages", _pages)
    app.connect("html-page-context", _navigate_quickly, priority=100)
    return {"parallel_read_safe": False, "parallel_write_safe": True}
