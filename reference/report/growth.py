"""How the errors of chains that run freely grow from bounce to bounce."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from reference.comparison.records import Growth, Outcome
from reference.report import svg
from reference.report.scatter import COLORS, power

WIDTH, HEIGHT = 4.9, 2.6
PANEL, LEFT, BOTTOM, TOP = 1.75, 0.55, 0.5, 0.3


def draw_growth(outcomes: Sequence[Outcome]) -> Figure | None:
    """Left in lengths of the scene, right in units of what is allowed; None where no chain was followed."""
    chains = {outcome.precision: outcome for outcome in outcomes if outcome.growth}
    if not chains:
        return None
    figure = Figure(figsize=(WIDTH, HEIGHT))
    height = HEIGHT - BOTTOM - TOP
    left = svg.axes_of(figure, LEFT, BOTTOM, PANEL, height)
    right = svg.axes_of(figure, WIDTH - PANEL - 0.12, BOTTOM, PANEL, height)
    left.set_title("between the two tracers, in S", fontsize=8, loc="left")
    right.set_title("in ε S × gain", fontsize=8, loc="left")
    for precision, outcome in chains.items():
        color = COLORS.get(precision, svg.INK)
        _line(left, outcome.growth, "median", color)
        _line(left, outcome.growth, "most", color, ls=(0, (4, 2)))
        _line(right, outcome.growth, "scaled", color, ls=(0, (1, 1.5)))
        _line(right, outcome.growth, "ours", color)
    some = next(iter(chains.values()))
    _line(right, some.growth, "mitsuba", svg.MITSUBA)
    right.axhline(some.allowed, color=svg.BAD, lw=1)
    right.text(0.02, some.allowed * 0.82, "allowed", color=svg.BAD, fontsize=7, va="top",
               transform=right.get_yaxis_transform())  # fmt: skip
    vertices = [entry.vertex for outcome in chains.values() for entry in outcome.growth]
    for axes in (left, right):
        axes.set(yscale="log", xlabel="vertex of the chain", xlim=(min(vertices) - 0.3, max(vertices) + 0.3))
        axes.set_xticks(range(min(vertices), max(vertices) + 1))
        axes.yaxis.set_major_formatter(FuncFormatter(power))
        axes.minorticks_off()
        axes.grid(axis="y")
    return figure


def _line(axes: Axes, growth: Sequence[Growth], name: str, color: str, **look: object) -> None:
    """A number a vertex; what is 0 has no place on the scale and leaves a gap."""
    values = np.array([getattr(entry, name) for entry in growth], float)
    values[~(values > 0)] = np.nan
    if np.isfinite(values).any():
        axes.plot([entry.vertex for entry in growth], values, color=color, marker="o", ms=2.2, **look)  # type: ignore[arg-type]
