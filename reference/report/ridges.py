"""How large errors are, in ulp: a ridge a term, with our errors in both precisions and Mitsuba's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from reference.comparison.records import Outcome
from reference.report import svg

ROW, LEFT, WIDTH = 0.36, 1.8, 4.6  # inches
LEAST_BINS = 14
HIGHEST = 0.92  # of a ridge, in rows
TICKS = {0: "0", 4: "⅛", 7: "1", 10: "8", 13: "64", 16: "512", 19: "4,096", 22: "2¹⁵", 25: "2¹⁸",
         28: "2²¹", 31: "2²⁴"}  # fmt: skip
"""Borders of the bins of a spectrum, by number, and what they are in ulp."""
LOOKS = (("mitsuba", svg.MITSUBA, 0.8), ("single", svg.SINGLE, 1.3), ("double", svg.DOUBLE, 1.3))

Ridge = tuple[int, int, np.ndarray]
"""First and last bin that is not empty, and the heights from the one to the other."""


def draw_ridges(outcomes: Sequence[Outcome]) -> Figure | None:
    """The spectra of one scene; None where it has none."""
    rows = _rows(outcomes)
    if not rows:
        return None
    bins = max(LEAST_BINS, 2 + max(last for row in rows.values() for _, last, _ in row.values()))
    height = ROW * len(rows)
    figure = Figure(figsize=(LEFT + WIDTH + 0.15, height + 0.75))
    axes = svg.axes_of(figure, LEFT, 0.5, WIDTH, height + 0.2)
    bases = np.arange(len(rows))[::-1]
    axes.hlines(bases, 0, bins, color=svg.LINE, lw=0.6)
    for side, color, width in LOOKS:
        outlines = [
            _outline(*row[side], base) for base, row in zip(bases, rows.values(), strict=True) if side in row
        ]
        if not outlines:
            continue
        if side == "mitsuba":
            axes.add_collection(PolyCollection(outlines, facecolors=color, alpha=0.28, lw=0))
        gap = np.full((1, 2), np.nan)
        axes.plot(
            *np.concatenate([part for outline in outlines for part in (outline, gap)]).T,
            color=color,
            lw=width,
        )
    ticks = [tick for tick in TICKS if tick <= bins]
    axes.set(
        xlim=(0, bins), ylim=(-0.12, len(rows) + 0.45), xlabel="error in ulp, each side in its own precision"
    )
    axes.set_xticks(ticks, [TICKS[tick] for tick in ticks])
    axes.set_yticks(bases + 0.1, list(rows), color=svg.INK)
    axes.spines["left"].set_visible(False)
    axes.grid(axis="x")
    return figure


def _rows(outcomes: Sequence[Outcome]) -> dict[str, dict[str, Ridge]]:
    """By term and side; the highest bin of a row is as high as any other row's, not counting what is exact,
    which may be nearly all: its bin, the first, is cut off there."""
    counts: dict[str, dict[str, np.ndarray]] = {}
    for outcome in outcomes:
        if outcome.spectrum is not None:
            row = counts.setdefault(outcome.term, {})
            row[outcome.precision] = np.asarray(outcome.spectrum.ours, float)
            row.setdefault("mitsuba", np.asarray(outcome.spectrum.mitsuba, float))
    rows = {}
    for term, row in counts.items():
        shares = {side: values / values.sum() for side, values in row.items() if values.any()}
        if shares:
            top = max(share[1:].max() for share in shares.values()) or 1.0
            rows[term] = {
                side: _ridge(HIGHEST * np.minimum(share / top, 1)) for side, share in shares.items()
            }
    return rows


def _ridge(heights: np.ndarray) -> Ridge:
    first, last = np.flatnonzero(heights)[[0, -1]].tolist()
    return first, last, heights[first : last + 1]


def _outline(first: int, last: int, heights: np.ndarray, base: float) -> np.ndarray:
    """Corners (n, 2) of the steps, from the base line and back to it."""
    x = np.repeat(np.arange(first, last + 2), 2)
    return np.stack([x, base + np.concatenate([[0], np.repeat(heights, 2), [0]])], axis=1)
