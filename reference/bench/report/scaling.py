"""What many more triangles cost a ray, from the rates that were measured."""

from __future__ import annotations

from typing import NamedTuple

from reference.bench.rays import KINDS
from reference.bench.records import Benchmark, Rate
from reference.bench.report.rates import rate_pairs
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
    measured = {(pair.mesh, pair.kind): pair for pair in rate_pairs(benchmark)}
    sizes = {mesh: MESHES[mesh] ** 2 for mesh in MESHES if any(mesh == each for each, _ in measured)}
    apart = [(a, b) for a in sizes for b in sizes if sizes[b] == TIMES * sizes[a]]
    return [
        Scaling(kind, small, large, _cost(before.tracer, after.tracer), _cost(before.embree, after.embree))
        for small, large in apart[-1:]
        for kind in KINDS
        if (before := measured.get((small, kind))) and (after := measured.get((large, kind)))
    ]


def _cost(before: Rate | None, after: Rate | None) -> float:
    return before.per_second / after.per_second if before and after else float("nan")


def title_of(scaling: Scaling) -> str:
    """What the numbers are."""
    return f"What {TIMES} times the triangles cost a ray, from {scaling.small} to {scaling.large}"
