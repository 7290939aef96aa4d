"""The few numbers that a run comes down to, all of them ratios."""

from __future__ import annotations

from math import isnan
from typing import NamedTuple

from reference.bench.records import PEERS, Benchmark
from reference.bench.report.rates import rate_pairs
from reference.bench.report.scaling import TIMES, scaling_of
from reference.bench.report.units import ratio

COHERENT = "primary, tile order"


SCENES = ("room", "room-82k")
"""Those that are named, where they were measured."""


class Headline(NamedTuple):
    """A ratio and what it is."""

    value: float
    words: str


def headline_of(benchmark: Benchmark) -> list[Headline]:
    """Frames of scenes against the peers, rays against Embree on the largest mesh that was measured, and what
    more triangles cost."""
    found = []
    scenes = next((group.points for group in benchmark.groups if group.name == "scenes"), ())
    named = [point for point in scenes if point.name in SCENES]
    for point in named or scenes[:2]:
        for peer in ("mitsuba", "povray"):
            if not isnan(point.ratio(peer)):
                words = f"times as long as tracer takes {PEERS[peer]} for a frame of {point.name}"
                found.append(Headline(point.ratio(peer), words))
    for kind in (COHERENT, "shadow"):
        pairs = [pair for pair in rate_pairs(benchmark) if pair.kind == kind and not isnan(pair.ratio)]
        words = "times Embree's rays a second: {0.kind}, mesh {0.mesh}"
        found += [Headline(pair.ratio, words.format(pair)) for pair in pairs[-1:]]
    for each in scaling_of(benchmark):
        if each.kind == COHERENT and not isnan(each.tracer):
            beside = "" if isnan(each.embree) else f" (Embree: {ratio(each.embree)})"
            words = (
                f"times the cost of a primary ray for {TIMES} times the triangles, to {each.large}{beside}"
            )
            found.append(Headline(each.tracer, words))
    return found
