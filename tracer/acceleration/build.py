"""Builds the bounding volume hierarchy over all triangles, by the surface area heuristic.

Top down, all nodes of a level at once in vectorized NumPy: the centroids of a node's triangles fall into 16
bins on each axis, and the node is cut between the two bins where the expected cost is least (Wald, On Fast
Construction of SAH-based Bounding Volume Hierarchies, 2007). The root is the bounding box of the document's
section 5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

BINS = 16

LARGEST_LEAF = 4
"""Triangles of a leaf at most; fewer where cutting is cheaper. The layout has room for 7."""

NODE_COST = 1.0
"""Cost of visiting a node, in tests of a triangle."""


@dataclass(frozen=True)
class Hierarchy:
    """A binary tree of n nodes, parents before children, the root first.

    `lower`, `upper` (n, 3): boxes; `left` (n,): left child, the right one follows it, 0 for a leaf; `first`,
    `count` (n,): a leaf's triangles are `order[first : first + count]`; `levels`: where each level of nodes
    ends.
    """

    lower: np.ndarray
    upper: np.ndarray
    left: np.ndarray
    first: np.ndarray
    count: np.ndarray
    order: np.ndarray
    levels: list[int]


@dataclass
class _Triangles:
    """Boxes and centroids of all triangles (n, 3)."""

    lower: np.ndarray
    upper: np.ndarray
    center: np.ndarray


def build_hierarchy(corners: np.ndarray) -> Hierarchy:
    """The hierarchy of n >= 1 triangles with `corners` (n, 3, 3).

    Degenerate triangles may be among them: the triangle test never accepts them.
    """
    n = len(corners)
    lower, upper = corners.min(axis=1), corners.max(axis=1)
    triangles = _Triangles(lower, upper, lower + (upper - lower) / 2)
    order = np.arange(n)
    boxes = np.empty((2, 2 * n - 1, 3))
    left, first, count = (np.zeros(2 * n - 1, np.int64) for _ in range(3))
    count[0] = n
    begin, end, levels = 0, 1, [1]
    while begin < end:
        nodes = np.arange(begin, end)
        members = _Members(first[nodes], count[nodes])
        ids = order[members.places]
        boxes[0, nodes] = np.minimum.reduceat(lower[ids], members.offsets)
        boxes[1, nodes] = np.maximum.reduceat(upper[ids], members.offsets)
        in_left, cut = _cut(triangles, ids, members, boxes[:, nodes])
        # Members of a cut node: those of the left child first, otherwise in the order they had.
        sizes = members.sums(in_left)
        order[members.partitioned(in_left, sizes)] = ids
        cut_nodes, sizes = nodes[cut], sizes[cut]
        left[cut_nodes] = end + 2 * np.arange(len(cut_nodes))
        children = left[cut_nodes]
        first[children], count[children] = first[cut_nodes], sizes
        first[children + 1], count[children + 1] = first[cut_nodes] + sizes, count[cut_nodes] - sizes
        begin, end = end, end + 2 * len(cut_nodes)
        levels.append(end)
    return Hierarchy(boxes[0, :end], boxes[1, :end], left[:end], first[:end], count[:end], order, levels[:-1])


class _Members:
    """The triangles of some nodes, laid end to end: `places` in the order, `node` number among these
    nodes."""

    def __init__(self, first: np.ndarray, count: np.ndarray) -> None:
        self.count = count
        self.offsets = np.cumsum(count) - count
        self.node = np.repeat(np.arange(len(count)), count)
        self.first = first
        self.places = np.arange(len(self.node)) + (first - self.offsets)[self.node]

    def sums(self, mask: np.ndarray) -> np.ndarray:
        """How many members of each node are in the mask."""
        return np.bincount(self.node[mask], minlength=len(self.count))

    def partitioned(self, in_left: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """New places: the members in the mask before the others of their node."""
        before = np.cumsum(in_left) - in_left  # members in the mask before this one, over all nodes
        rank_left = before - before[self.offsets][self.node]
        rank_right = np.arange(len(before)) - self.offsets[self.node] - rank_left + sizes[self.node]
        return self.first[self.node] + np.where(in_left, rank_left, rank_right)


def _cut(
    triangles: _Triangles, ids: np.ndarray, members: _Members, boxes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Which members go to the left child, and which nodes are cut at all."""
    center = triangles.center[ids]
    low = np.minimum.reduceat(center, members.offsets)
    extent = np.maximum.reduceat(center, members.offsets) - low
    scale = np.divide(BINS, extent, out=np.zeros_like(extent), where=extent > 0)
    bins = ((center - low[members.node]) * scale[members.node]).astype(np.int64)
    bins = np.minimum(bins, BINS - 1)
    costs = np.stack([_costs(triangles, ids, members, bins[:, axis]) for axis in range(3)], axis=1)
    flat = costs.reshape(len(costs), -1)
    best = flat.argmin(axis=1)
    least = flat[np.arange(len(flat)), best]
    axis, place = np.divmod(best, BINS - 1)
    in_left = bins[np.arange(len(bins)), axis[members.node]] <= place[members.node]
    # Where all centroids coincide no bin tells triangles apart: half and half.
    rank = np.arange(len(ids)) - members.offsets[members.node]
    in_left = np.where(np.isinf(least)[members.node], rank < members.count[members.node] // 2, in_left)
    area = _half_area(boxes[1] - boxes[0])
    dearer = least + NODE_COST * area >= members.count * area
    cut = (members.count > LARGEST_LEAF) | ((members.count > 1) & ~dearer)
    return in_left, cut


def _costs(triangles: _Triangles, ids: np.ndarray, members: _Members, bins: np.ndarray) -> np.ndarray:
    """(nodes, BINS - 1): area times triangles of both sides, added up, for a cut after each bin but the last;
    infinite where one side is empty."""
    nodes = len(members.count)
    key = members.node * BINS + bins
    count = np.bincount(key, minlength=nodes * BINS).reshape(nodes, BINS)
    low, high = np.full((3, nodes * BINS), np.inf), np.full((3, nodes * BINS), -np.inf)
    for axis in range(3):
        np.minimum.at(low[axis], key, triangles.lower[ids, axis])
        np.maximum.at(high[axis], key, triangles.upper[ids, axis])
    boxes = low.reshape(3, nodes, BINS), high.reshape(3, nodes, BINS)
    left = _growing(count, *boxes)
    right = _growing(count[:, ::-1], *(box[..., ::-1] for box in boxes))
    return left[:, :-1] + right[:, -2::-1]


def _growing(count: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(nodes, BINS) area times triangles of the first bins: of one, of two, ...; infinite where they are
    empty."""
    number = np.cumsum(count, axis=1)
    size = np.maximum.accumulate(high, axis=2) - np.minimum.accumulate(low, axis=2)
    area = _half_area(np.moveaxis(np.where(number > 0, size, 0), 0, -1))
    return np.where(number > 0, area * number, np.inf)


def _half_area(size: np.ndarray) -> np.ndarray:
    """xy + yz + zx of extents (..., 3)."""
    x, y, z = size[..., 0], size[..., 1], size[..., 2]
    return x * y + y * z + z * x
