"""Builds a bounding volume hierarchy, over all triangles or many spheres, by the surface area heuristic.

Top down: the centroids of a node's boxes fall into 16 bins on each axis, and the node is cut between the
two bins where the expected cost is least (Wald, On Fast Construction of SAH-based Bounding Volume
Hierarchies, 2007). Large nodes are cut a level at a time, with a lane for every chunk of boxes
(`bins.py`); small ones down to the leaves, with a lane for each (`subtrees.py`). The kernels only decide
which box goes where; those of nodes are made of the given ones, so that they are exact on every backend. What
lies in the boxes plays no part: where these rooms speak of triangles, spheres are as good. Over triangles the
root is the bounding box of the document's section 5.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tracer.acceleration.bins import BOX_WORDS
from tracer.acceleration.large_nodes import cut_large_nodes
from tracer.acceleration.subtrees import build_subtrees
from tracer.backends import Backend, exact_arithmetic


@dataclass(frozen=True)
class Hierarchy:
    """A binary tree of n nodes, level by level, the root first.

    `lower`, `upper` (n, 3) float32: boxes; `left` (n,): left child, the right one follows it, 0 for a leaf;
    `first`, `count` (n,): what lies below a node is `order[first : first + count]`; `levels`: where each
    level of nodes ends.
    """

    lower: np.ndarray
    upper: np.ndarray
    left: np.ndarray
    first: np.ndarray
    count: np.ndarray
    order: np.ndarray
    levels: list[int]

    def families(self) -> list[tuple[np.ndarray, slice]]:
        """The inner nodes of each level that has some, and where their children lie, side by side."""
        inner = [begin + np.flatnonzero(self.left[begin:end]) for begin, end in pairwise([0, *self.levels])]
        return [
            (nodes, slice(end, end + 2 * len(nodes)))
            for nodes, end in zip(inner, self.levels, strict=True)
            if len(nodes)
        ]


def build_hierarchy(backend: Backend, corners: np.ndarray) -> Hierarchy:
    """The hierarchy of n >= 1 triangles with `corners` (n, 3, 3) in single precision numbers.

    Degenerate triangles may be among them: the triangle test never accepts them.
    """
    a, b, c = (corners[:, k].astype(np.float32) for k in range(3))
    return build_over_boxes(backend, np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c))


def build_over_boxes(backend: Backend, lower: np.ndarray, upper: np.ndarray) -> Hierarchy:
    """The hierarchy of whatever lies in n >= 1 boxes `lower`, `upper` (n, 3) float32."""
    with exact_arithmetic():
        table = backend.single_table(_box_rows(lower, upper))
        table, top, first, count = cut_large_nodes(backend, table, len(lower))
        found = build_subtrees(backend, table, backend.id_table(first), backend.id_table(count))
        left, leaf, slots = (x.numpy().astype(np.int64) for x in found)
    numbers = table.numpy().view(np.uint32).reshape(-1, BOX_WORDS)[:, 6]
    left, leaf, root = _with_top(left, leaf, top)
    nodes, children, levels = _by_level(left, root)
    order = numbers[slots].astype(np.int64)
    return _with_boxes(lower[order], upper[order], order, leaf[nodes], children, levels)


def _box_rows(lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Boxes for the kernels: scaled by a power of two so that coordinates are below 1, and numbered."""
    rows = np.empty((len(lower), BOX_WORDS), np.float32)
    largest = max(np.abs(lower).max(), np.abs(upper).max())
    exponent = -int(np.frexp(largest)[1])
    rows[:, 0:3], rows[:, 3:6] = np.ldexp(lower, exponent), np.ldexp(upper, exponent)
    rows.view(np.uint32)[:, 6] = np.arange(len(rows))
    return rows


def _with_top(left: np.ndarray, leaf: np.ndarray, top: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """The nodes of the subtrees, then those `top` (n,) above them: for a large node its left child among
    these, for the root of a subtree -1 - its place. Returns `left`, `leaf` and the place of the root."""
    root = len(left)
    is_large = top >= 0
    place = np.where(is_large, 0, -1 - top)
    above = np.where(is_large, root + top, left[place])
    return np.concatenate([left, above]), np.concatenate([leaf, np.where(is_large, 0, leaf[place])]), root


def _by_level(left: np.ndarray, root: int) -> tuple[np.ndarray, np.ndarray, list[int]]:
    """Places of the nodes level by level, the left child of each by its number among these (0: a leaf), and
    where levels end."""
    level, nodes, children, levels = np.array([root]), [], [], [1]
    while len(level):
        below = left[level]
        inner = below > 0
        number = levels[-1] + 2 * (inner.cumsum() - 1)
        nodes.append(level)
        children.append(np.where(inner, number, 0))
        level = (below[inner, None] + [0, 1]).ravel()
        levels.append(levels[-1] + len(level))
    return np.concatenate(nodes), np.concatenate(children), levels[:-1]


def _with_boxes(
    lower: np.ndarray,
    upper: np.ndarray,
    order: np.ndarray,
    leaf: np.ndarray,
    left: np.ndarray,
    levels: list[int],
) -> Hierarchy:
    """The hierarchy of triangles with boxes `lower`, `upper` (m, 3) in its order; `leaf`: as in
    `build_subtrees`."""
    first, count = leaf >> 3, leaf & 7
    boxes = np.empty((2, len(left), 3), np.float32)
    leaves = np.flatnonzero(count)
    starts = np.zeros(len(order), bool)
    starts[first[leaves]] = True
    rank = (starts.cumsum() - 1)[first[leaves]]
    starts = np.flatnonzero(starts)
    boxes[0, leaves] = np.minimum.reduceat(lower, starts)[rank]
    boxes[1, leaves] = np.maximum.reduceat(upper, starts)[rank]
    for begin, end in list(pairwise([0, *levels]))[::-1]:
        nodes = begin + np.flatnonzero(left[begin:end])
        if len(nodes):
            below = slice(end, end + 2 * len(nodes))
            pairs = boxes[:, below]
            boxes[0, nodes] = np.minimum(pairs[0, 0::2], pairs[0, 1::2])
            boxes[1, nodes] = np.maximum(pairs[1, 0::2], pairs[1, 1::2])
            first[nodes] = first[below][0::2]
            count[nodes] = count[below][0::2] + count[below][1::2]
    return Hierarchy(boxes[0], boxes[1], left, first, count, order, levels)
