"""What the pages of reports share: how templates are filled in, the style sheets, the script."""

from __future__ import annotations

from pathlib import Path

import jinja2

from reference.report import numbers

TEMPLATES = Path(__file__).resolve().parent / "templates"


def environment(*folders: Path) -> jinja2.Environment:
    """Templates of these folders; a name that has no value is an error."""
    made = jinja2.Environment(
        loader=jinja2.FileSystemLoader(folders),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    for name in ("number", "count", "percent", "times", "unit"):
        made.filters[name] = getattr(numbers, name)
    return made


def css() -> str:
    """Both style sheets."""
    return "".join((TEMPLATES / name).read_text(encoding="utf-8") for name in ("report.css", "scene.css"))


def script() -> str:
    """What makes the page move; it loads nothing."""
    return (TEMPLATES / "report.js").read_text(encoding="utf-8")
