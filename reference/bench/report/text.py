"""A run in a few lines for a terminal."""

from __future__ import annotations

from math import isnan

from reference.bench.rays import KINDS
from reference.bench.records import PEERS, Benchmark, Build, Point
from reference.bench.report.scaling import Scaling, scaling_of, title_of
from reference.bench.report.units import duration, million, ratio


def table_of(benchmark: Benchmark) -> str:
    """A line a picture, a kind of ray and a mesh."""
    lines = []
    for group in benchmark.groups:
        lines += [group.title, *(f"  {_picture(point)}" for point in group.points)]
    meshes = dict.fromkeys(rate.mesh for rate in benchmark.rates)
    lines += ["Million rays a second"] if meshes else []
    lines += [f"  {_rate(benchmark, mesh, kind)}" for mesh in meshes for kind in KINDS]
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


def _rate(benchmark: Benchmark, mesh: str, kind: str) -> str:
    of = {rate.peer: rate for rate in benchmark.rates if (rate.mesh, rate.kind) == (mesh, kind)}
    names = {"tracer": "tracer", "mitsuba": "Embree"}
    words = [f"{names[peer]} {million(rate.per_second)}" for peer, rate in of.items()]
    if len(of) == 2:
        words.append(f"ratio {ratio(of['tracer'].per_second / of['mitsuba'].per_second)}")
    return f"{mesh:6} {kind:20} {', '.join(words)}"


def _cost(each: Scaling) -> str:
    return f"{each.kind:27} tracer {ratio(each.tracer)} times, Embree {ratio(each.embree)} times"


def _build(each: Build) -> str:
    times = f"reading {duration(each.read.least)}, hierarchy {duration(each.build.least)}"
    return f"{each.mesh:6} {PEERS[each.peer]:10} {times}"
