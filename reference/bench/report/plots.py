"""The drawings of the page: what other renderers take in units of tracer's own time, on logarithmic axes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isnan

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from reference.bench.records import PEERS, Group
from reference.bench.report.rates import RatePair
from reference.bench.report.units import duration
from reference.report import svg

COLORS = {"tracer": svg.SINGLE, "mitsuba": svg.MITSUBA, "povray": svg.DOUBLE}
WIDTH, HEIGHT = 4.4, 2.55
"""Inches: narrow enough to be read on a phone; the page puts drawings side by side where there is room."""

LEFT, RIGHT, BOTTOM, TOP = 0.65, 0.15, 0.5, 0.3
NAMES, VALUES = 1.45, 0.45
"""Inches beside bars: their names, and room for the last number."""

BAR = 0.25
"""Inches: the height of one bar and its gap."""


def draw_times(group: Group) -> Figure:
    """A curve a renderer: the time of a frame."""
    curves = {
        peer: [(p.x, frame.trace.median) for p in group.points if (frame := p.frame(peer)) is not None]
        for peer in COLORS
    }
    return _curves(group, "time of a frame", curves, _round_duration)


def draw_quotients(group: Group) -> Figure:
    """A curve a renderer: its time over tracer's."""
    curves = {
        peer: [(p.x, p.ratio(peer)) for p in group.points if not isnan(p.ratio(peer))] for peer in COLORS
    }
    return _curves(group, "time over tracer's", curves, lambda value: f"{value:g} ×")


def _curves(
    group: Group, title: str, curves: dict[str, list[tuple[float, float]]], text: Callable[[float], str]
) -> Figure:
    figure = Figure(figsize=(WIDTH, HEIGHT))
    axes = svg.axes_of(figure, LEFT, BOTTOM, WIDTH - LEFT - RIGHT, HEIGHT - BOTTOM - TOP)
    axes.set_title(title, fontsize=8, loc="left")
    for peer, values in curves.items():
        if values:
            axes.plot(*zip(*values, strict=True), color=COLORS[peer], marker="o", ms=2.6)
    axes.set(xscale="log", yscale="log", xlabel=group.axis)
    axes.set_xticks([point.x for point in group.points], [point.name for point in group.points])
    axes.minorticks_off()
    axes.grid(axis="y")
    _label(axes, text)
    return figure


def draw_ratios(group: Group, peer: str) -> Figure:
    """A bar a scene: the time of one renderer over tracer's; the line at 1 is tracer."""
    ratios = {point.name: point.ratio(peer) for point in group.points if not isnan(point.ratio(peer))}
    rows = [(name, value, COLORS[peer]) for name, value in ratios.items()]
    return _bars(rows, f"{PEERS[peer]}, time over tracer's", list(ratios.values()))


def draw_rates(pairs: Sequence[RatePair], mesh: str) -> Figure:
    """A bar a kind of ray: tracer's rays a second over Embree's; the line at 1 is Embree. All meshes have the
    same axis."""
    known = [pair for pair in pairs if not isnan(pair.ratio)]
    rows = [(pair.kind, pair.ratio, COLORS["tracer"]) for pair in known if pair.mesh == mesh]
    return _bars(rows, "rays a second over Embree's", [pair.ratio for pair in known])


def _bars(rows: Sequence[tuple[str, float, str]], label: str, values: Sequence[float]) -> Figure:
    """`values`: all that the axis has to reach."""
    height = max(1, len(rows)) * BAR
    figure = Figure(figsize=(WIDTH, height + BOTTOM + 0.1))
    axes = svg.axes_of(figure, NAMES, BOTTOM, WIDTH - NAMES - VALUES, height)
    places = np.arange(len(rows))[::-1]
    for place, (_, value, color) in zip(places, rows, strict=True):
        axes.plot([1, value], [place, place], color=color, lw=7, solid_capstyle="butt")
        axes.annotate(
            f"{value:.2f}" if value < 10 else f"{value:.0f}",
            (value, place),
            (4 if value >= 1 else -4, 0),
            textcoords="offset points",
            va="center",
            ha="left" if value >= 1 else "right",
            fontsize=7.5,
        )
    axes.axvline(1, color=svg.INK, lw=1)
    axes.set(xscale="log", xlabel=label, ylim=(-0.6, len(rows) - 0.4))
    axes.set_xlim(min(0.5, 0.6 * min(values, default=1)), max(2.0, 1.3 * max(values, default=1)))
    axes.set_yticks(places, [name for name, _, _ in rows])
    axes.minorticks_off()
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=12))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.grid(axis="x")
    return figure


def _round_duration(seconds: float) -> str:
    """1, 2 or 5 of some unit, without the digits behind."""
    return duration(seconds).replace(".00 ", " ").replace(".0 ", " ")


def _label(axes: Axes, text: Callable[[float], str]) -> None:
    low, high = axes.get_ylim()
    steps = (1.0, 2.0, 5.0) if high / low < 100 else (1.0,)
    axes.yaxis.set_major_locator(LogLocator(subs=steps, numticks=12))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: text(value)))
    axes.yaxis.set_minor_formatter(NullFormatter())
