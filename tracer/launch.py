"""One launch: pixels through the loop; their layers, and what was counted."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import drjit as dr

from tracer.aovs import compute_layers
from tracer.backends import Backend
from tracer.canvas import DeviceCanvas
from tracer.device_scene import DeviceScene
from tracer.first_hits import FirstHits
from tracer.pixel_records import scattered
from tracer.pixels import Lanes
from tracer.replay import Program
from tracer.whitted import Counts, trace_pixels

COUNTERS = tuple(f.name for f in fields(Counts))


@Program
def trace_lanes(
    device: DeviceScene,
    canvas: DeviceCanvas,
    lanes: Lanes,
    first: FirstHits | None,
    layers: tuple[str, ...],
    shapes: int,
) -> dict[str, Any]:
    """The layers of the pixels of `lanes` as records, each in its place, and the counters of `COUNTERS` (1,),
    each under its `count_of`. `first`: see `first_hits`; `shapes`: how many there are, if the rays
    that meet each are to be counted as `hits`, else 0."""
    backend = device.backend
    pixels = lanes.pixels(backend, dr.arange(backend.UInt32, lanes.count))
    met = dr.opaque(backend.UInt64, 0, shapes) if shapes else None
    found = trace_pixels(device, canvas, pixels, first, layers, met)
    values = {"color": found.color, "alpha": found.coverage, "depth": found.depth, "z": found.view_depth}
    if layers:
        values |= compute_layers(device, canvas, pixels, found, layers)
    components = {name: _components(value) for name, value in values.items()}
    picture = scattered(backend, components, lanes.places(backend, pixels), pixels.active, lanes.room)
    hits = {} if met is None else {count_of("hits"): met}
    return picture | _totals(backend, found.counts) | hits


def counts_of(found: dict[str, Any]) -> dict[str, Any]:
    """Takes the counts out of what a launch gives: numbers by name, `hits` a list."""
    counts = {name: int(found.pop(count_of(name)).numpy()[0]) for name in COUNTERS}
    hits = found.pop(count_of("hits"), None)
    return counts if hits is None else counts | {"hits": hits.numpy().tolist()}


def count_of(name: str) -> str:
    """The name of a counter among the layers, some of which are called alike."""
    return f"number of {name}"


def _components(value: Any) -> list[Any]:
    """The components (n,) of a list, a vector or a number."""
    return list(value) if isinstance(value, list) or dr.depth_v(value) > 1 else [value]


def _totals(backend: Backend, counts: Counts) -> dict[str, Any]:
    """Sums over the lanes of a launch, 64 bits wide; of the levels the largest.

    Whole numbers, so the order in which the lanes add them makes no difference.
    """
    totals = {count_of(name): dr.zeros(backend.UInt64, 1) for name in COUNTERS}
    for name in COUNTERS:
        op = dr.ReduceOp.Max if name == "deepest_level" else dr.ReduceOp.Add
        lanes = backend.UInt64(getattr(counts, name))
        dr.scatter_reduce(op, totals[count_of(name)], lanes, backend.UInt32(0))
    return totals
