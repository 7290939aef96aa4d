"""The drawings of the page: what other renderers take in units of tracer's own time, on logarithmic axes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isnan

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from reference.bench.rays import KINDS
from reference.bench.records import PEERS, Group, Rate
from reference.bench.report.units import duration
from reference.report import svg

COLORS = {"tracer": svg.SINGLE, "mitsuba": svg.MITSUBA, "povray": svg.DOUBLE}
WIDTH, HEIGHT = 7.2, 2.7
PANEL, LEFT, BOTTOM, TOP = 2.7, 0.65, 0.5, 0.3
BAR = 0.36
"""Inches: the height of one bar and its gap."""


def draw_curve(group: Group) -> Figure:
    """Left: milliseconds of tracing; right: each renderer's time over tracer's."""
    figure = Figure(figsize=(WIDTH, HEIGHT))
    height = HEIGHT - BOTTOM - TOP
    left = svg.axes_of(figure, LEFT, BOTTOM, PANEL, height)
    right = svg.axes_of(figure, WIDTH - PANEL - 0.15, BOTTOM, PANEL, height)
    left.set_title("time of a frame", fontsize=8, loc="left")
    right.set_title("time over tracer's", fontsize=8, loc="left")
    for peer, color in COLORS.items():
        times = [(p.x, frame.trace.median) for p in group.points if (frame := p.frame(peer)) is not None]
        ratios = [(p.x, p.ratio(peer)) for p in group.points if not isnan(p.ratio(peer))]
        for axes, values in ((left, times), (right, ratios)):
            if values:
                axes.plot(*zip(*values, strict=True), color=color, marker="o", ms=2.6)
    places = [point.x for point in group.points]
    for axes in (left, right):
        axes.set(xscale="log", yscale="log", xlabel=group.axis)
        axes.set_xticks(places, [point.name for point in group.points])
        axes.minorticks_off()
        axes.grid(axis="y")
    _label(left, lambda value: duration(value))
    _label(right, lambda value: f"{value:g} ×")
    return figure


def draw_ratios(group: Group) -> Figure:
    """A bar a scene and renderer: its time over tracer's; the line at 1 is tracer."""
    rows = [
        (point.name, peer, point.ratio(peer))
        for point in group.points
        for peer in PEERS
        if peer != "tracer" and not isnan(point.ratio(peer))
    ]
    return _bars(
        [(f"{name}  {PEERS[peer]}", value, COLORS[peer]) for name, peer, value in rows], "time over tracer's"
    )


def draw_rates(rates: Sequence[Rate], mesh: str) -> Figure:
    """A bar a kind of ray: tracer's rays a second over Embree's; the line at 1 is Embree."""
    of = {(rate.kind, rate.peer): rate.per_second for rate in rates if rate.mesh == mesh}
    rows = [
        (kind, of[kind, "tracer"] / of[kind, "mitsuba"], COLORS["tracer"])
        for kind in KINDS
        if (kind, "tracer") in of and (kind, "mitsuba") in of
    ]
    return _bars(rows, "rays a second over Embree's")


def _bars(rows: Sequence[tuple[str, float, str]], label: str) -> Figure:
    figure = Figure(figsize=(WIDTH, max(1, len(rows)) * BAR * 0.7 + BOTTOM + 0.1))
    axes = svg.axes_of(figure, 2.1, BOTTOM, WIDTH - 2.8, max(1, len(rows)) * BAR * 0.7)
    places = np.arange(len(rows))[::-1]
    for place, (_, value, color) in zip(places, rows, strict=True):
        axes.plot([1, value], [place, place], color=color, lw=7, solid_capstyle="butt")
        beyond = 4 if value >= 1 else -4
        axes.annotate(
            f"{value:.2g}" if value < 10 else f"{value:.0f}",
            (value, place),
            (beyond, 0),
            textcoords="offset points",
            va="center",
            ha="left" if value >= 1 else "right",
            fontsize=7.5,
        )
    axes.axvline(1, color=svg.INK, lw=1)
    values = [value for _, value, _ in rows] or [1.0]
    axes.set(xscale="log", xlabel=label, ylim=(-0.6, len(rows) - 0.4))
    axes.set_xlim(min(0.5, 0.6 * min(values)), max(2.0, 1.6 * max(values)))
    axes.set_yticks(places, [name for name, _, _ in rows])
    axes.minorticks_off()
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=12))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.grid(axis="x")
    return figure


def _label(axes: Axes, text: Callable[[float], str]) -> None:
    low, high = axes.get_ylim()
    steps = (1.0, 2.0, 5.0) if high / low < 100 else (1.0,)
    axes.yaxis.set_major_locator(LogLocator(subs=steps, numticks=12))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: text(value)))
    axes.yaxis.set_minor_formatter(NullFormatter())
