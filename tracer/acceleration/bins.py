"""Bins of the surface area heuristic, as kernels: counted, weighed, and triangles parted by the best cut.

The builder works on boxes of triangles, `BOX_WORDS` words each: lower and upper corner, the triangle's number
(a bit pattern), one unused. Coordinates are below 1, so that no product leaves the range of single precision
upwards; where one vanishes downwards all cuts cost the same, and any is as good as another.

A lane walks through triangles that lie end to end and counts them in bins of its own. So nothing is added up
in an order that depends on threads, and every kernel serves nodes of all sizes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.backends import Backend
from tracer.ray import select_max, select_min

BINS = 16
"""Bins on each axis (Wald, On Fast Construction of SAH-based Bounding Volume Hierarchies, 2007)."""

BOX_WORDS = 8

SMALLEST_EXTENT = 1e-36
"""Centroids no farther apart than this count as one: bins per length stay finite."""

COUNT = 6
"""Word of a bin, after the box of its triangles: how many they are."""


@dataclass
class Cut:
    """n cuts: triangles in bins below `place` of the `axis` go to the left child; twice their centroid is in
    bin (x - `low`) `scale`."""

    axis: Any
    low: Any
    scale: Any
    place: Any

    def bin(self, backend: Backend, x: Any) -> Any:
        """Number of the bin."""
        return backend.UInt32(select_min((x - self.low) * self.scale, type(x)(BINS - 1)))


def fetch_box(backend: Backend, table: Any, slot: Any) -> Any:
    """Reads boxes (BOX_WORDS, n)."""
    return dr.gather(backend.SingleN, table, slot, shape=(BOX_WORDS, dr.width(slot)))


def fetch_centroid(table: Any, slot: Any, axis: Any) -> Any:
    """Twice the centroid of boxes on one axis."""
    at = slot * BOX_WORDS + axis
    return dr.gather(type(table), table, at) + dr.gather(type(table), table, at + 3)


def clear_bins(bins: Any, zero: Any, start: Any) -> None:
    """Empties bins in local memory. `zero`: 0 at full width; local memory written at width 1 is garbage in a
    loop. `start`: 0 at width 1, in memory, for Dr.Jit loses some host memory with every write whose place is
    a literal."""
    for k in range(BINS):
        at = start + BOX_WORDS * k
        for word in range(3):
            bins[at + word] = zero + dr.inf
            bins[at + 3 + word] = zero - dr.inf
        bins[at + COUNT] = zero


def count_in_bin(bins: Any, number: Any, box: Any) -> None:
    """Adds a box to a bin in local memory."""
    at = number * BOX_WORDS
    for k in range(3):
        bins[at + k] = select_min(bins[at + k], box[k])
        bins[at + 3 + k] = select_max(bins[at + 3 + k], box[3 + k])
    bins[at + COUNT] = bins[at + COUNT] + 1


def read_bin(bins: Any, number: Any) -> list[Any]:
    """Box and count of a bin in local memory, `COUNT` + 1 numbers."""
    return [bins[number * BOX_WORDS + word] for word in range(COUNT + 1)]


def joined(a: list[Any], b: list[Any]) -> list[Any]:
    """Box and count of two together."""
    lower = [select_min(x, y) for x, y in zip(a[:3], b[:3], strict=True)]
    upper = [select_max(x, y) for x, y in zip(a[3:6], b[3:6], strict=True)]
    return [*lower, *upper, a[COUNT] + b[COUNT]]


def half_area(box: list[Any]) -> Any:
    """xy + yz + zx of a box."""
    x, y, z = (box[3 + k] - box[k] for k in range(3))
    return x * y + y * z + z * x


def weight(box: list[Any]) -> Any:
    """Area times triangles; infinite where there are none."""
    return dr.select(box[COUNT] > 0, half_area(box) * box[COUNT], dr.inf)


def nothing(zero: Any) -> list[Any]:
    """Box and count of no triangles, at the width of `zero`."""
    return [zero + dr.inf] * 3 + [zero - dr.inf] * 3 + [zero]


@dr.syntax
def chunk_extents(backend: Backend, table: Any, begin: Any, end: Any, axis: Any) -> tuple[Any, Any]:
    """Least and largest doubled centroid of the boxes from `begin` to `end` on an axis, each (n,)."""
    slot = backend.UInt32(begin)
    low = dr.full(type(table), dr.inf, dr.width(begin))
    high = -low
    while dr.hint(slot < end, label="extents", exclude=[backend]):
        x = fetch_centroid(table, slot, axis)
        low, high = select_min(low, x), select_max(high, x)
        slot = slot + 1
    return low, high


@dr.syntax
def chunk_bins(backend: Backend, table: Any, begin: Any, end: Any, cut: Cut) -> Any:
    """Bins of the boxes from `begin` to `end` along the cut's axis, flat: n times BINS times BOX_WORDS."""
    n = dr.width(begin)
    bins = dr.alloc_local(type(table), BINS * BOX_WORDS)
    slot = backend.UInt32(begin)
    clear_bins(bins, dr.zeros(type(table), n), backend.opaque_id(0))
    while dr.hint(slot < end, label="bins", exclude=[backend]):
        count_in_bin(
            bins, cut.bin(backend, fetch_centroid(table, slot, cut.axis)), fetch_box(backend, table, slot)
        )
        slot = slot + 1
    result = dr.empty(type(table), n * BINS * BOX_WORDS)
    number, unused = dr.zeros(backend.UInt32, n), dr.zeros(type(table), n)
    place = dr.arange(backend.UInt32, n) * BINS
    while dr.hint(number < BINS, label="write", exclude=[backend, result]):
        dr.scatter(result, backend.SingleN([*read_bin(bins, number), unused]), place + number)
        number = number + 1
    dr.eval(result)
    return result


@dr.syntax
def parted(backend: Backend, table: Any, begin: Any, end: Any, cut: Cut, left: Any, right: Any) -> Any:
    """The boxes in a new order: those from `begin` to `end` that the cut sends left lie from `left` on, the
    others from `right` on, in the order they had. Every slot must be in one of the n stretches."""
    result = dr.empty(type(table), dr.width(table))
    slot, left, right = backend.UInt32(begin), backend.UInt32(left), backend.UInt32(right)
    while dr.hint(slot < end, label="part", exclude=[backend, result]):
        goes_left = cut.bin(backend, fetch_centroid(table, slot, cut.axis)) < cut.place
        dr.scatter(result, fetch_box(backend, table, slot), dr.select(goes_left, left, right))
        left, right = dr.select(goes_left, left + 1, left), dr.select(goes_left, right, right + 1)
        slot = slot + 1
    dr.eval(result)
    return result
