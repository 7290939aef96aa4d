"""Rays of one kind on one mesh by both hierarchies, side by side."""

from __future__ import annotations

from typing import NamedTuple

from reference.bench.rays import KINDS
from reference.bench.records import Benchmark, Rate

NAMES = {"tracer": "tracer", "mitsuba": "Embree"}
"""Who answers, by peer."""


class RatePair(NamedTuple):
    """What was measured of a kind of rays on a mesh: None where a side was not asked."""

    mesh: str
    kind: str
    tracer: Rate | None
    embree: Rate | None

    @property
    def ratio(self) -> float:
        """Tracer's rays a second over Embree's, NaN where one is missing."""
        if self.tracer is None or self.embree is None:
            return float("nan")
        return self.tracer.per_second / self.embree.per_second


def rate_pairs(benchmark: Benchmark) -> list[RatePair]:
    """Mesh by mesh, kind by kind, as far as something was measured."""
    of = {(rate.mesh, rate.kind, rate.peer): rate for rate in benchmark.rates}
    pairs = [
        RatePair(mesh, kind, *(of.get((mesh, kind, peer)) for peer in NAMES))
        for mesh in dict.fromkeys(rate.mesh for rate in benchmark.rates)
        for kind in KINDS
    ]
    return [pair for pair in pairs if pair.tracer or pair.embree]
