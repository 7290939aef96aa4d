"""How large errors are, in ulp: a ridge a term, with our errors in both precisions and Mitsuba's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reference.comparison.records import Outcome
from reference.report import svg

ROW, LEFT, WIDTH = 0.36, 1.45, 4.75  # inches
LEAST_BINS = 14
TICKS = {0: "0", 1: "1⁄64", 4: "⅛", 7: "1", 10: "8", 13: "64", 16: "512", 19: "4,096", 22: "2¹⁵", 25: "2¹⁸",
         28: "2²¹", 31: "2²⁴"}  # fmt: skip
"""Borders of the bins of a spectrum, by number, and what they are in ulp."""


def draw_ridges(outcomes: Sequence[Outcome]) -> Figure | None:
    """The spectra of one scene; None where it has none."""
    rows: dict[str, dict[str, np.ndarray]] = {}
    for outcome in outcomes:
        spectrum = outcome.spectrum
        if spectrum is not None and spectrum.ours.sum() + spectrum.mitsuba.sum():
            row = rows.setdefault(outcome.term, {})
            row[outcome.precision] = np.asarray(spectrum.ours, float)
            row.setdefault("mitsuba", np.asarray(spectrum.mitsuba, float))
    if not rows:
        return None
    filled = [
        int(np.flatnonzero(counts)[-1]) for row in rows.values() for counts in row.values() if counts.any()
    ]
    bins = max(LEAST_BINS, max(filled) + 2)
    height = ROW * len(rows)
    figure = Figure(figsize=(LEFT + WIDTH + 0.15, height + 0.75))
    axes = svg.axes_of(figure, LEFT, 0.5, WIDTH, height + 0.2)
    for place, row in enumerate(rows.values()):
        _draw_row(axes, len(rows) - 1 - place, row)
    ticks = [tick for tick in TICKS if tick <= bins]
    axes.set(xlim=(0, bins), ylim=(-0.12, len(rows) + 0.45), xlabel="error in ulp of its own precision")
    axes.set_xticks(ticks, [TICKS[tick] for tick in ticks])
    axes.set_yticks([len(rows) - 1 - place + 0.1 for place in range(len(rows))], list(rows), color=svg.INK)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.grid(axis="x")
    return figure


def _draw_row(axes: Axes, base: float, row: dict[str, np.ndarray]) -> None:
    """Shares of the rays in each bin; the highest bin of a row is as high as any other row's."""
    shares = {side: counts / counts.sum() for side, counts in row.items() if counts.any()}
    top = max(share.max() for share in shares.values()) / 1.15
    axes.axhline(base, color=svg.LINE, lw=0.6)
    for side, color, filled in (
        ("mitsuba", svg.MITSUBA, True),
        ("single", svg.SINGLE, False),
        ("double", svg.DOUBLE, False),
    ):
        if side not in shares:
            continue
        first, last = np.flatnonzero(shares[side])[[0, -1]]
        values, edges = base + shares[side][first : last + 1] / top, np.arange(first, last + 2)
        if filled:
            axes.stairs(values, edges, baseline=base, fill=True, color=color, alpha=0.28, lw=0)
        axes.stairs(values, edges, baseline=base, color=color, lw=0.8 if filled else 1.3)
