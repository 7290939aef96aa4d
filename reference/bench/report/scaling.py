"""What many more triangles cost a ray, from the rates that were measured."""

from __future__ import annotations

from math import isnan
from typing import NamedTuple

from reference.bench.rays import KINDS
from reference.bench.records import Benchmark
from reference.bench.scenes import MESHES

TIMES = 16
"""How many times the triangles: so far apart are 82k and 1.3M."""


class Scaling(NamedTuple):
    """One kind of rays: how many times as long one takes in the mesh `large` as in `small`, which has a
    sixteenth of its triangles; NaN where a side was not measured."""

    kind: str
    small: str
    large: str
    tracer: float
    embree: float


def scaling_of(benchmark: Benchmark) -> list[Scaling]:
    """Of every kind on the two largest meshes that are so far apart; none where no two are."""
    rates = {(rate.mesh, rate.kind, rate.peer): rate.per_second for rate in benchmark.rates}
    measured = [mesh for mesh in MESHES if any(rate.mesh == mesh for rate in benchmark.rates)]
    pairs = [(a, b) for a in measured for b in measured if MESHES[b] ** 2 == TIMES * MESHES[a] ** 2]
    if not pairs:
        return []
    small, large = pairs[-1]

    def cost(kind: str, peer: str) -> float:
        before, after = (rates.get((mesh, kind, peer), float("nan")) for mesh in (small, large))
        return before / after

    found = [Scaling(kind, small, large, cost(kind, "tracer"), cost(kind, "mitsuba")) for kind in KINDS]
    return [each for each in found if not (isnan(each.tracer) and isnan(each.embree))]


def title_of(scaling: Scaling) -> str:
    """What the numbers are."""
    return f"What {TIMES} times the triangles cost a ray, from {scaling.small} to {scaling.large}"
