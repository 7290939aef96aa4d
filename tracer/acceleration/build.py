"""Builds the bounding volume hierarchy: triangles sorted along a Morton curve under a complete binary tree.

The tree needs no links. Node 1 is the root (the bounding box of the document's section 5), the children of
node i are 2i and 2i+1, and the last `leaf_count` nodes are the leaves, two triangle slots each. Lauterbach et
al., Fast BVH Construction on GPUs, 2009, for the order; everything here is vectorized NumPy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LEAF_SLOTS = 2
"""Triangle slots of a leaf; an odd one out is filled with the previous triangle."""


@dataclass(frozen=True)
class Hierarchy:
    """`boxes` (2 leaf_count, 6): lower and upper corner of each node (row 0 unused); `order` (slots,):
    triangles."""

    boxes: np.ndarray
    order: np.ndarray
    leaf_count: int


def build_hierarchy(corners: np.ndarray) -> Hierarchy:
    """The hierarchy of n >= 1 triangles with `corners` (n, 3, 3); O(n log n), a few ms for 10,000 triangles.

    Degenerate triangles may be among them: the triangle test never accepts them.
    """
    lower, upper = corners.min(axis=1), corners.max(axis=1)
    sorted_ids = np.argsort(_morton_codes((lower + upper) / 2), kind="stable")
    leaf_count = 1 << max(0, int(np.ceil(np.log2(len(corners) / LEAF_SLOTS))))
    order = sorted_ids[_slots(len(corners), leaf_count)]
    boxes = np.zeros((2 * leaf_count, 6))
    by_leaf = order.reshape(leaf_count, LEAF_SLOTS)
    boxes[leaf_count:, :3] = lower[by_leaf].min(axis=1)
    boxes[leaf_count:, 3:] = upper[by_leaf].max(axis=1)
    first = leaf_count // 2
    while first >= 1:
        children = boxes[2 * first : 4 * first].reshape(first, 2, 6)
        boxes[first : 2 * first, :3] = children[:, :, :3].min(axis=1)
        boxes[first : 2 * first, 3:] = children[:, :, 3:].max(axis=1)
        first //= 2
    return Hierarchy(boxes, order.astype(np.uint32), leaf_count)


def _slots(count: int, leaf_count: int) -> np.ndarray:
    """Positions in the sorted order that fill the leaves evenly, one or two different ones a leaf."""
    begin = np.arange(leaf_count, dtype=np.int64) * count // leaf_count
    end = np.arange(1, leaf_count + 1, dtype=np.int64) * count // leaf_count
    slots = np.minimum(begin[:, None] + np.arange(LEAF_SLOTS), np.maximum(end - 1, begin)[:, None])
    return np.minimum(slots, count - 1).ravel()


def _morton_codes(points: np.ndarray) -> np.ndarray:
    """63-bit Morton codes of points (n, 3) in their common bounding box."""
    low = points.min(axis=0)
    extent = np.maximum(points.max(axis=0) - low, np.finfo(np.float64).tiny)
    cells = np.minimum((points - low) / extent * 2.0**21, 2.0**21 - 1).astype(np.uint64)
    code = np.zeros(len(points), np.uint64)
    for axis in range(3):
        code |= _spread_bits(cells[:, axis]) << np.uint64(axis)
    return code


def _spread_bits(x: np.ndarray) -> np.ndarray:
    """Puts two zero bits between the 21 lowest bits of x."""
    for shift, mask in (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        x = (x | (x << np.uint64(shift))) & np.uint64(mask)
    return x
