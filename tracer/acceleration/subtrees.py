"""Small subtrees of the hierarchy, one a lane, cut down to the leaves in a single kernel."""

from __future__ import annotations

from typing import Any

import drjit as dr

from tracer.acceleration.bins import (
    BINS,
    BOX_WORDS,
    SMALLEST_EXTENT,
    Cut,
    clear_bins,
    count_in_bin,
    fetch_box,
    fetch_centroid,
    half_area,
    joined,
    nothing,
    read_bin,
    weight,
)
from tracer.backends import Backend
from tracer.ray import select_max, select_min

LARGEST_SUBTREE = 128
"""Triangles of a subtree at most: what a lane holds in local memory."""

LARGEST_LEAF = 4
"""Triangles of a leaf at most; fewer where cutting is cheaper. The layout has room for 7."""

NODE_COST = 1.0
"""Cost of visiting a node, in tests of a triangle."""


@dr.syntax
def build_subtrees(backend: Backend, table: Any, first: Any, count: Any) -> tuple[Any, Any, Any]:
    """Subtrees over the boxes in the slots from `first` on, `count` (n,) each.

    Returns `left`, `leaf` by node and `order` by slot. The nodes of a subtree stand from 2 `first` on,
    parents before children: `left` is the left child, which the right one follows, 0 for a leaf; `leaf` its
    first slot times 8 plus its triangles, 0 for other nodes. `order`: the slot in the table of what is in a
    slot now.
    """
    n, word = dr.width(first), backend.UInt32
    slots = dr.width(table) // BOX_WORDS
    left_of, leaf_of, order_of = dr.zeros(word, 2 * slots), dr.zeros(word, 2 * slots), dr.zeros(word, slots)
    # Slots and ranges of slots count from `first`; a range is its begin times 256 plus its length.
    order, ranges = dr.alloc_local(word, LARGEST_SUBTREE), dr.alloc_local(word, 2 * LARGEST_SUBTREE + 1)
    bins, tails = dr.alloc_local(type(table), BINS * BOX_WORDS), dr.alloc_local(type(table), BINS)
    slot = dr.zeros(word, n)
    while dr.hint(slot < count, label="fill", exclude=[backend]):
        order[slot] = slot
        slot = slot + 1
    node, nodes, start = dr.zeros(word, n), dr.full(word, 1, n), backend.opaque_id(0)
    ranges[start] = word(count)
    while dr.hint(node < nodes, label="nodes", exclude=[backend, start, left_of, leaf_of]):
        begin, size = ranges[node] >> 8, ranges[node] & 0xFF
        cut, cost, area, bins, tails = _best_cut(
            backend, table, first, order, begin, size, bins, tails, start
        )
        triangles = type(table)(size)
        split = (size > LARGEST_LEAF) | ((size > 1) & (cost + NODE_COST * area < triangles * area))
        middle, order = _part(backend, table, first, order, begin, dr.select(split, size, 0), cut)
        # Where all centroids coincide no bin tells triangles apart: half and half.
        middle = dr.select(cost == dr.inf, begin + size // 2, middle)
        dr.scatter(left_of, dr.select(split, 2 * first + nodes, 0), 2 * first + node)
        dr.scatter(leaf_of, dr.select(split, 0, (first + begin) << 3 | size), 2 * first + node)
        ranges[nodes] = begin << 8 | (middle - begin)
        ranges[nodes + 1] = middle << 8 | (begin + size - middle)
        nodes = dr.select(split, nodes + 2, nodes)
        node = node + 1
    slot = dr.zeros(word, n)
    while dr.hint(slot < count, label="order", exclude=[backend, order_of]):
        dr.scatter(order_of, first + order[slot], first + slot)
        slot = slot + 1
    dr.eval(left_of, leaf_of, order_of)
    return left_of, leaf_of, order_of


@dr.syntax
def _best_cut(
    backend: Backend,
    table: Any,
    first: Any,
    order: Any,
    begin: Any,
    size: Any,
    bins: Any,
    tails: Any,
    start: Any,
) -> tuple[Cut, Any, Any, Any, Any]:
    """The cheapest cut of a node, area times triangles of its sides added up (infinite where nothing tells
    the triangles apart), the node's half area, and the local memory for bins as it is then."""
    n, word = dr.width(first), backend.UInt32
    zero = dr.zeros(type(table), n)
    axis, end = dr.zeros(word, n), begin + size
    best = Cut(dr.zeros(word, n), zero + 0, zero + 0, dr.zeros(word, n))
    least, area = zero + dr.inf, zero + 0
    while dr.hint((axis < 3) & (size > 1), label="axes", exclude=[backend, start]):
        slot = word(begin)
        low, high = zero + dr.inf, zero - dr.inf
        while dr.hint(slot < end, label="extents", exclude=[backend]):
            x = fetch_centroid(table, first + order[slot], axis)
            low, high = select_min(low, x), select_max(high, x)
            slot = slot + 1
        apart = high - low
        scale = dr.select(apart > SMALLEST_EXTENT, BINS / apart, 0)
        cut = Cut(axis, low, scale, word(axis))
        clear_bins(bins, zero, start)
        slot = word(begin)
        while dr.hint(slot < end, label="bins", exclude=[backend]):
            at = first + order[slot]
            count_in_bin(
                bins, cut.bin(backend, fetch_centroid(table, at, axis)), fetch_box(backend, table, at)
            )
            slot = slot + 1
        place, cost, area, tails = _best_place(backend, bins, tails, zero)
        cut = Cut(axis, low, scale, place)
        better = cost < least
        best, least = dr.select(better, cut, best), dr.select(better, cost, least)
        axis = axis + 1
    return best, least, area, bins, tails


@dr.syntax
def _best_place(backend: Backend, bins: Any, tails: Any, zero: Any) -> tuple[Any, Any, Any, Any]:
    """Bins on the left of the cheapest cut, its cost, half the area of all bins, and the local memory for
    the costs of right sides."""
    number = dr.full(backend.UInt32, BINS - 1, dr.width(zero))
    box = nothing(zero)
    while dr.hint(number > 0, label="right sides", exclude=[backend]):
        box = joined(box, read_bin(bins, number))
        tails[number] = weight(box)
        number = number - 1
    area = half_area(joined(box, read_bin(bins, number)))
    box, place, least = nothing(zero), backend.UInt32(number), zero + dr.inf
    while dr.hint(number < BINS - 1, label="left sides", exclude=[backend]):
        box = joined(box, read_bin(bins, number))
        number = number + 1
        cost = weight(box) + tails[number]
        place, least = dr.select(cost < least, number, place), select_min(least, cost)
    return place, least, area, tails


@dr.syntax
def _part(
    backend: Backend, table: Any, first: Any, order: Any, begin: Any, size: Any, cut: Cut
) -> tuple[Any, Any]:
    """Parts a node's triangles by a cut, in place: where the right child begins, and the order."""
    left, right = backend.UInt32(begin), begin + size
    while dr.hint(left < right, label="part", exclude=[backend]):
        here, there = order[left], order[right - 1]
        goes_left = cut.bin(backend, fetch_centroid(table, first + here, cut.axis)) < cut.place
        order[left] = dr.select(goes_left, here, there)
        order[right - 1] = dr.select(goes_left, there, here)
        left, right = dr.select(goes_left, left + 1, left), dr.select(goes_left, right, right - 1)
    return left, order
