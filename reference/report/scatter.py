"""Errors against the distance of a ray from the nearest silhouette or edge: where rounding decides."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter

from reference.comparison.records import Outcome
from reference.report import svg
from reference.report.bounds import RAYS
from reference.report.numbers import SUPERSCRIPTS
from reference.tolerances import TOLERANCES

WIDTH, HEIGHT = 4.9, 2.9
LEFT, BOTTOM, TOP, GAP = 0.6, 0.5, 0.3, 0.2
COLORS = {"single": svg.SINGLE, "double": svg.DOUBLE}
LOWEST = 1e-5  # share of the allowance: what is smaller is drawn here, zeros too
NEAREST, FARTHEST = 1e-1, 1e8  # eps S: what is nearer or farther is drawn there
CELLS = (90, 90)
"""Columns and rows of a grid; of the dots in a square, which would cover each other, one is drawn."""


def draw_scatter(outcomes: Sequence[Outcome]) -> Figure | None:
    """Differences of the sampled rays of one scene as shares of what is allowed, a panel a precision; None
    without samples."""
    sampled = [outcome for outcome in outcomes if len(outcome.samples)]
    precisions = [name for name in COLORS if any(o.precision == name for o in sampled)]
    if not precisions:
        return None
    figure = Figure(figsize=(WIDTH, HEIGHT))
    width = (WIDTH - LEFT - 0.12 - GAP * (len(precisions) - 1)) / len(precisions)
    for place, name in enumerate(precisions):
        axes = svg.axes_of(figure, LEFT + place * (width + GAP), BOTTOM, width, HEIGHT - BOTTOM - TOP)
        _draw_panel(axes, [outcome for outcome in sampled if outcome.precision == name], COLORS[name])
        axes.set_title(f"ours in {name} precision", fontsize=8, loc="left", color=COLORS[name])
        if place:
            axes.set_yticklabels([])
        else:
            axes.set_ylabel("share of the allowance")
    return figure


def _draw_panel(axes: Axes, outcomes: Sequence[Outcome], color: str) -> None:
    axes.set(xscale="log", yscale="log", xlim=(NEAREST / 2, FARTHEST * 2), ylim=(LOWEST / 2, 12))
    band = TOLERANCES["grazing band"].value
    axes.axvspan(NEAREST / 2, band, color=svg.QUIET, alpha=0.16, lw=0)
    axes.axhline(1, color=svg.BAD, lw=1)
    points = [_points(outcome) for outcome in outcomes if outcome.unit != RAYS and outcome.allowed > 0]
    if points:
        x, y = (np.concatenate(column) for column in zip(*points, strict=True))
        _dots(axes, x, y, color)
    differ = [o.distance_to_silhouette[o.samples > 0] for o in outcomes if o.unit == RAYS]
    crosses = np.concatenate([np.zeros(0), *differ])
    if len(crosses):
        axes.plot(_inside(crosses), np.full(len(crosses), 4.0), "x", color=svg.BAD, ms=4, mew=1.1)
    axes.text(NEAREST * 0.7, 1.25, "all that is allowed", color=svg.BAD, fontsize=7, va="bottom")
    axes.text(
        NEAREST * 0.7, LOWEST, f"grazing\nband,\n{band:g} ε S", color=svg.QUIET, fontsize=7, va="bottom"
    )
    axes.set(xlabel="distance from the silhouette, in ε S")
    axes.xaxis.set_major_locator(FixedLocator([10.0**k for k in range(-1, 9, 2)]))
    axes.xaxis.set_major_formatter(FuncFormatter(power))
    axes.yaxis.set_major_formatter(FuncFormatter(power))
    axes.minorticks_off()
    axes.grid()


def power(value: float, _: object = None) -> str:
    """A power of ten as a label; those that are short in full."""
    exponent = round(np.log10(value))
    return f"{value:g}" if -2 <= exponent <= 2 else f"10{str(exponent).translate(SUPERSCRIPTS)}"


def _points(outcome: Outcome) -> tuple[np.ndarray, np.ndarray]:
    return outcome.distance_to_silhouette, np.asarray(outcome.samples, float) / outcome.allowed


def _inside(distance: np.ndarray) -> np.ndarray:
    """Distances on the axis; a scene without any edge is everywhere far."""
    return np.clip(np.nan_to_num(distance, nan=FARTHEST, posinf=FARTHEST), NEAREST, FARTHEST)


def _dots(axes: Axes, x: np.ndarray, y: np.ndarray, color: str) -> None:
    """Lines of length 0 with round ends in one path: a marker each would be five times the text."""
    y = np.clip(np.nan_to_num(y, nan=10, posinf=10), LOWEST, 10)
    x = _inside(x)
    spans = np.log([FARTHEST / NEAREST, 10 / LOWEST])
    cells = np.log(np.stack([x / NEAREST, y / LOWEST], axis=1)) / spans * CELLS
    _, kept = np.unique(np.rint(cells), axis=0, return_index=True)
    x, y = x[kept], y[kept]
    gaps = np.full(len(x), np.nan)
    axes.plot(
        np.stack([x, x, gaps], axis=1).ravel(), np.stack([y, y, gaps], axis=1).ravel(),
        color=color, lw=1.9, alpha=0.5, solid_capstyle="round",
    )  # fmt: skip
