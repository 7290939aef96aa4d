"""The hierarchy as kernels walk it: threaded, and laid out eight times, once for every octant of directions.

A copy lists the nodes depth first, the child that rays of its octant meet first before the other. A ray that
meets a node's box goes on with the next node of the list, a ray that misses it jumps over the whole subtree:
no stack. Nodes that are not worth a test are left out (`contraction.py`). Planes are stored in the order in
which those rays cross them (Smits, Efficiency Issues for Ray Tracing, 1998).

Planes are whole numbers of 16 bits, steps of a grid over the root, rounded outwards (`grid.py`): a node has
16 bytes. Where the grid is too coarse for a part of the scene, planes stay floats, and a node has 32.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from tracer.acceleration.build import Hierarchy
from tracer.acceleration.contraction import worth_testing
from tracer.acceleration.grid import Grid, find_grid
from tracer.backends import Backend

OCTANTS = 8
"""Octant o holds the directions whose component k is negative where bit k of o is set."""

GRID_WORDS, FLOAT_WORDS = 4, 8
"""Words of 32 bits of a node. On a grid: for each axis the plane crossed first in the low half of a word and
the one crossed last in the high half, then the link. Else: the planes crossed first as floats, the link, the
planes crossed last, 0."""

LEAF = 1 << 31
"""The link of a leaf is this, 8 times its first slot, and how many slots it has (1 to 7); a ray goes on with
the next node in either case. The link of any other node is where a ray goes on that misses it."""


@dataclass
class NodeLists:
    """Eight lists of `count` (width 1) nodes each, in Dr.Jit memory, and one node that nobody reads for its
    content: lanes at the end of the last list fetch it. `grid`: the unit of the planes, None where they are
    floats; `extent` (width 1): the largest |coordinate|."""

    words: Any
    count: Any
    grid: Grid | None
    extent: Any


def threaded(backend: Backend, tree: Hierarchy) -> NodeLists:
    """The lists of a tree."""
    kept = worth_testing(tree)
    sizes = _subtree_sizes(tree, kept)
    found = find_grid(tree)
    links = np.where(tree.left == 0, LEAF | tree.first << 3 | tree.count, sizes).astype(np.uint32)
    rows = _float_rows(tree, links) if found is None else found.rows(tree, links)
    count = backend.opaque_id(sizes[0])
    places = backend.id_table(_places(tree, sizes, kept)[kept].T)
    words = _written(backend, backend.id_table(rows[kept]), places, count, rows.shape[1])
    return NodeLists(
        words=words,
        count=count,
        grid=None if found is None else found.on_device(backend),
        extent=backend.opaque(max(-tree.lower[0].min(), tree.upper[0].max())),
    )


def _float_rows(tree: Hierarchy, links: np.ndarray) -> np.ndarray:
    rows = np.zeros((len(links), FLOAT_WORDS), np.float32)
    rows[:, 0:3], rows[:, 4:7] = tree.lower, tree.upper
    rows = rows.view(np.uint32)
    rows[:, 3] = links
    return rows


@dr.syntax
def _written(backend: Backend, rows: Any, places: Any, n: Any, node_words: int) -> Any:
    """Writes every node into each list, its planes in the order in which they are crossed."""
    node = dr.arange(backend.UInt32, dr.width(rows) // node_words)
    words = dr.gather(backend.IdN, rows, node, shape=(node_words, dr.width(node)))
    is_leaf = words[3] >= LEAF
    lists = dr.zeros(type(rows), OCTANTS * dr.width(rows) + node_words)
    dr.eval(lists)
    octant = dr.zeros(backend.UInt32, dr.width(node))
    while dr.hint(octant < OCTANTS, label="octants", exclude=[backend, lists]):
        place = octant * n + dr.gather(backend.UInt32, places, octant * n + node)
        link = dr.select(is_leaf, words[3], place + words[3])
        dr.scatter(lists, backend.IdN(_crossed_in_order(octant, words, link)), place)
        octant = octant + 1
    dr.eval(lists)
    return lists


def _crossed_in_order(octant: Any, words: Any, link: Any) -> list[Any]:
    """The words of nodes in the list of an octant: planes that it meets from the other side change places."""
    negative = [(octant & (1 << k)) != 0 for k in range(3)]
    if len(words) == GRID_WORDS:
        return [
            *(dr.select(negative[k], words[k] << 16 | words[k] >> 16, words[k]) for k in range(3)),
            link,
        ]
    first = [dr.select(negative[k], words[4 + k], words[k]) for k in range(3)]
    last = [dr.select(negative[k], words[k], words[4 + k]) for k in range(3)]
    return [*first, link, *last, words[7]]


def _subtree_sizes(tree: Hierarchy, kept: np.ndarray) -> np.ndarray:
    """Kept nodes of each subtree."""
    sizes = kept.astype(np.int32)
    for nodes, below in reversed(tree.families()):
        sizes[nodes] += sizes[below][0::2] + sizes[below][1::2]
    return sizes


def _places(tree: Hierarchy, sizes: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """(n, 8) where each node stands in the list of each octant, if it is kept.

    Of opposite octants one meets the right child first where the other meets the left one. So its list is the
    other's read backwards, with parents before their children: all - place - size + depth.
    """
    n = len(tree.left)
    place, depth = np.zeros((n, OCTANTS), np.int32), np.zeros((n, 1), np.int32)
    own = kept[:, None].astype(np.int32)
    negative = np.array([[octant >> k & 1 for octant in range(OCTANTS // 2)] for k in range(3)], bool)
    for nodes, below in tree.families():
        center = (tree.lower[below] + tree.upper[below]).reshape(-1, 2, 3)
        apart = center[:, 1] - center[:, 0]
        axis = np.abs(apart).argmax(axis=1)
        left_first = (apart[np.arange(len(nodes)), axis] >= 0)[:, None] != negative[axis]
        size = sizes[below].reshape(-1, 2, 1)
        begin, children = place[nodes, : OCTANTS // 2] + own[nodes], place[below, : OCTANTS // 2]
        children[0::2] = begin + np.where(left_first, 0, size[:, 1])
        children[1::2] = begin + np.where(left_first, size[:, 0], 0)
        depth[below] = np.repeat(depth[nodes] + own[nodes], 2, axis=0)
    place[:, OCTANTS // 2 :] = (sizes[0] - place[:, : OCTANTS // 2] - sizes[:, None] + depth)[:, ::-1]
    return place
