"""A run in a few lines for a terminal."""

from __future__ import annotations

from math import isnan

from reference.bench.records import PEERS, Benchmark, Build, Point
from reference.bench.report.rates import RatePair, rate_pairs
from reference.bench.report.scaling import Scaling, scaling_of, title_of
from reference.bench.report.units import duration, million, ratio


def table_of(benchmark: Benchmark) -> str:
    """A line a picture, a kind of ray and a mesh."""
    lines = []
    for group in benchmark.groups:
        lines += [group.title, *(f"  {_picture(point)}" for point in group.points)]
    lines += ["Million rays a second"] if benchmark.rates else []
    lines += [f"  {_rate(pair)}" for pair in rate_pairs(benchmark)]
    scaling = scaling_of(benchmark)
    lines += [title_of(scaling[0]), *(f"  {_cost(each)}" for each in scaling)] if scaling else []
    lines += ["From a file to a hierarchy"] if benchmark.builds else []
    return "\n".join([*lines, *(f"  {_build(each)}" for each in benchmark.builds)])


def _picture(point: Point) -> str:
    words = []
    for frame in point.frames:
        text = f"{PEERS[frame.peer]} {duration(frame.trace.median)}"
        times = point.ratio(frame.peer)
        words.append(text if frame.peer == "tracer" or isnan(times) else f"{text} ({ratio(times)} times)")
    return f"{point.name:12} {', '.join(words)}"


def _rate(pair: RatePair) -> str:
    sides = {"tracer": pair.tracer, "Embree": pair.embree}
    words = [f"{name} {million(rate.per_second)}" for name, rate in sides.items() if rate is not None]
    if not isnan(pair.ratio):
        words.append(f"ratio {ratio(pair.ratio)}")
    return f"{pair.mesh:6} {pair.kind:20} {', '.join(words)}"


def _cost(each: Scaling) -> str:
    return f"{each.kind:27} tracer {ratio(each.tracer)} times, Embree {ratio(each.embree)} times"


def _build(each: Build) -> str:
    times = f"reading {duration(each.read.least)}, hierarchy {duration(each.build.least)}"
    return f"{each.mesh:6} {PEERS[each.peer]:10} {times}"
