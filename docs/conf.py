"""Settings of the documentation site; `make docs` builds it into build/docs, without any network."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

from tracer.version import __version__  # noqa: E402

project = "whitted-tracer"
author = "The whitted-tracer authors"
copyright = "The whitted-tracer authors"
release = version = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "tracer_docs.commands",
    "tracer_docs.docstrings",
    "tracer_docs.gallery",
    "tracer_docs.glossary",
    "tracer_docs.pixel",
    "tracer_docs.sources",
    "tracer_docs.tutorial",
]
exclude_patterns = ["tracer_docs", "_build"]
default_role = "code"

# ---- Markdown: anchors as a repository's browser makes them, so that links work here and there ----
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence", "deflist"]

# ---- API ----
autodoc_member_order = "bysource"
autodoc_class_signature = "mixed"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_type_aliases = {"AnyLight": "AnyLight", "AnyShape": "AnyShape", "AnyTexture": "AnyTexture"}
autodoc_default_options = {"members": True, "undoc-members": True, "show-inheritance": True}
python_use_unqualified_type_names = True
add_module_names = False
napoleon_numpy_docstring = False
napoleon_use_rtype = False
toc_object_entries_show_parents = "hide"

nitpicky = True
# What autodoc says of aliases and bases; the inventories of other projects would have to be fetched.
nitpick_ignore = [
    ("py:class", name)
    for name in (
        "collections.abc.Callable",
        "collections.abc.Sequence",
        "numpy.ndarray",
        "pydantic.main.BaseModel",
    )
]
# ---- Looks ----
html_theme = "furo"
html_title = "whitted-tracer"
html_static_path = ["static"]
html_css_files = ["tracer.css"]
html_show_sphinx = False
html_copy_source = False
html_show_sourcelink = False
pygments_style = "tango"
pygments_dark_style = "monokai"
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#1f7a4d", "color-brand-content": "#1a6b44"},
    "dark_css_variables": {"color-brand-primary": "#7fd6a4", "color-brand-content": "#8fdcb0"},
}
