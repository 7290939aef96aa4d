"""A run in Markdown: ratios first, kept with the sources."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from reference.bench.records import PEERS, Benchmark, Group, Point, Rate
from reference.bench.report.headline import headline_of
from reference.bench.report.rates import rate_pairs
from reference.bench.report.scaling import scaling_of, title_of
from reference.bench.report.units import NOTHING, duration, mebibytes, million, ratio
from reference.report.header import COMMAND

READING = (
    "Times are medians of interleaved rounds in one run, minima in parentheses; other work on the machine "
    "moves them, so quote the ratios. A ratio above 1 means that tracer is faster. Frames are traced only: "
    "reading, hierarchies and processes are in tables of their own."
)


def summary_of(benchmark: Benchmark) -> str:
    """Headline, a table a group, rays a second, builds, what was left out, with what it was made."""
    facts = {name: value for name, value in benchmark.header.items() if name != COMMAND}
    lines = [
        "# Benchmark",
        "",
        *(f"- **{ratio(each.value)}** {each.words}" for each in headline_of(benchmark)),
    ]
    lines += ["", READING]
    for group in benchmark.groups:
        lines += ["", f"## {group.title}", "", *_table(group)]
    if any(point.processes for group in benchmark.groups for point in group.points):
        lines += ["", "## The first picture, and memory", "", *_processes(benchmark)]
    if benchmark.rates:
        lines += ["", "## Million rays a second, by kind", "", *_rates(benchmark)]
    scaling = scaling_of(benchmark)
    if scaling:
        costs = [(each.kind, f"{ratio(each.tracer)} ×", f"{ratio(each.embree)} ×") for each in scaling]
        lines += ["", f"## {title_of(scaling[0])}", "", *_rows(("rays", "tracer", "Embree"), costs)]
    if benchmark.builds:
        lines += ["", "## From a file to a hierarchy", "", *_builds(benchmark)]
    if benchmark.notes:
        lines += ["", "## What was left out", "", *(f"- {note}" for note in benchmark.notes)]
    lines += ["", "## With what it was made", "", *_rows(("what", "value"), facts.items())]
    if COMMAND in benchmark.header:
        lines += ["", f"To repeat it:\n\n    {benchmark.header[COMMAND]}"]
    return "\n".join(lines) + "\n"


def _table(group: Group) -> Iterator[str]:
    names = group.peers
    head = [group.axis, *(PEERS[peer] for peer in names)]
    head += [f"{PEERS[peer]} over tracer" for peer in names if peer != "tracer"]
    rows = []
    for point in group.points:
        ratios = [f"{ratio(point.ratio(p))} ({ratio(point.ratio(p, True))})" for p in names if p != "tracer"]
        rows.append([point.name, *(_time(point, peer) for peer in names), *ratios])
    return _rows(head, rows)


def _time(point: Point, peer: str) -> str:
    frame = point.frame(peer)
    return NOTHING if frame is None else f"{duration(frame.trace.median)} ({duration(frame.trace.least)})"


def _processes(benchmark: Benchmark) -> Iterator[str]:
    rows = [
        (
            point.name,
            PEERS[each.peer],
            *map(duration, (each.first, each.warm, each.later, each.process, each.warm_process)),
            mebibytes(each.peak),
        )
        for group in benchmark.groups
        for point in group.points
        for each in point.processes
    ]
    return _rows(
        (
            "scene",
            "renderer",
            "first frame ever",
            "first, kernels cached",
            "a later one",
            "process, first ever",
            "process, kernels cached",
            "most memory",
        ),
        rows,
    )


def _rates(benchmark: Benchmark) -> Iterator[str]:
    rows = [
        (pair.mesh, pair.kind, _million(pair.tracer), _million(pair.embree), ratio(pair.ratio))
        for pair in rate_pairs(benchmark)
    ]
    return _rows(("mesh", "rays", "tracer", "Embree", "tracer over Embree"), rows)


def _million(rate: Rate | None) -> str:
    return NOTHING if rate is None else million(rate.per_second)


def _builds(benchmark: Benchmark) -> Iterator[str]:
    rows = [
        (f"{each.triangles:,}", PEERS[each.peer], duration(each.read.least), duration(each.build.least))
        for each in benchmark.builds
    ]
    return _rows(("triangles", "renderer", "reading the file", "the hierarchy"), rows)


def _rows(head: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    yield f"| {' | '.join(head)} |"
    yield f"|{'---|' * len(head)}"
    for row in rows:
        yield f"| {' | '.join(row)} |"
