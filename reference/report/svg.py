"""Matplotlib figures as SVG inside the page: colors and letters come from the page's style sheet."""

from __future__ import annotations

import io
import re
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

INK, QUIET, LINE, PAPER = "#010101", "#020202", "#030303", "#040404"
SINGLE, DOUBLE, MITSUBA, BAD = "#050505", "#060606", "#070707", "#080808"
"""Stand-ins that the page's variables replace, so that one drawing serves the light and the dark look."""

_VARIABLES = {
    INK: "ink", QUIET: "quiet", LINE: "line", PAPER: "paper",
    SINGLE: "single", DOUBLE: "double", MITSUBA: "mitsuba", BAD: "bad",
}  # fmt: skip
_LEFT_OUT = (
    (r"<!--.*?-->|<metadata>.*?</metadata>|<style.*?</style>", ""),
    (r'<path d="[^"]*" style="fill: none"/>', ""),  # the empty grounds of figure and axes
    (r"font: ([\d.]+)px [^;\"]+", r"font-size: \1px"),
    (r" font-family: [^;\"]+;", ""),
    (r' transform="rotate\(-0 [^)]*\)"', ""),
    (r'(?<=[xy]=")(-?\d+\.\d\d)\d+', r"\1"),
)
"""What Matplotlib writes and the page has no use for; letters are those of the page."""
_STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.image_inline": True,
    "path.simplify": False,
    "text.color": INK,
    "axes.edgecolor": QUIET,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.labelsize": 8,
    "xtick.bottom": False,
    "ytick.left": False,
    "xtick.color": QUIET,
    "ytick.color": QUIET,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "grid.color": LINE,
    "grid.linewidth": 0.5,
    "font.size": 8,
    "lines.linewidth": 1.3,
}


def style() -> Any:
    """The context in which figures of the page are made and written."""
    return mpl.rc_context(_STYLE)


def axes_of(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Axes at a place given in inches, from the lower left corner."""
    w, h = figure.get_size_inches()
    return figure.add_axes((left / w, bottom / h, width / w, height / h))


def svg_of(figure: Figure, name: str, description: str) -> str:
    """The element `svg`, without what says nothing; `name` keeps its ids apart from those of other drawings
    on the page, `description` is its label, escaped."""
    stream = io.StringIO()
    figure.savefig(stream, format="svg", transparent=True, metadata={"Date": None})
    text = stream.getvalue()
    view = re.search(r'viewBox="[^"]+"', text)
    text = text[text.index("<defs>") : text.rindex("</svg>")]
    used = set(re.findall(r"(?:url\(#|href=\"#)([^)\"]+)", text))
    text = re.sub(r' id="([^"]+)"', lambda m: f' id="{name}-{m[1]}"' if m[1] in used else "", text)
    text = re.sub(r'(url\(#|href="#)', rf"\g<1>{name}-", text).replace("xlink:href", "href")
    for stand_in, variable in _VARIABLES.items():
        text = text.replace(stand_in, f"var(--{variable})")
    for pattern, kept in _LEFT_OUT:
        text = re.sub(pattern, kept, text, flags=re.DOTALL)
    if "<g " not in text:
        text = re.sub(r"</?g>", "", text)
    text = re.sub(r'(?<= d=")[^"]+', lambda m: _short(m[0]), text)
    text = re.sub(r"\s*\n\s*", "\n", text)
    return f'<svg role="img" aria-label="{description}" {view[0] if view else ""}>{text}</svg>'


def _short(path: str) -> str:
    """A path with a digit after the point, and dots (lines to where they start) as what takes least room."""
    path = re.sub(r"-?\d+\.\d+", lambda m: f"{float(m[0]):.1f}".removesuffix(".0"), path)
    path = re.sub(r"\s+", " ", path).strip()
    return re.sub(r"M (\S+) (\S+) L \1 \2 ?", r"M\1 \2h0", path)
