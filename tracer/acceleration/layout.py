"""The hierarchy as kernels walk it: threaded, and laid out eight times, once for every octant of directions.

A copy lists the nodes depth first, the child that rays of its octant meet first before the other. A ray that
meets a node's box goes on with the next node of the list, a ray that misses it jumps over the whole subtree:
no stack. Planes are stored in the order in which those rays cross them (Smits, Efficiency Issues for Ray
Tracing, 1998).
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import drjit as dr
import numpy as np

from tracer.acceleration.build import Hierarchy
from tracer.backends import Backend

NODE_WORDS = 8
"""Words of 32 bits of a node: three planes crossed first, where to jump, three planes crossed last, and for a
leaf its first triangle slot times 8 plus their number, else 0."""

OCTANTS = 8
"""Octant o holds the directions whose component k is negative where bit k of o is set."""


def threaded(backend: Backend, tree: Hierarchy) -> Any:
    """Eight lists of n nodes, `NODE_WORDS` words each, flat and in single precision; some words are bit
    patterns of unsigned integers."""
    n = len(tree.left)
    sizes = _subtree_sizes(tree)
    rows = np.empty((n, NODE_WORDS), np.float32)
    rows[:, 0:3], rows[:, 4:7] = tree.lower, tree.upper
    rows.view(np.uint32)[:, 3] = sizes
    rows.view(np.uint32)[:, 7] = np.where(tree.left == 0, tree.first << 3 | tree.count, 0)
    table, places = backend.single_table(rows), backend.id_table(_places(tree, sizes).T)
    return _written(backend, table, places, backend.opaque_id(n))


@dr.syntax
def _written(backend: Backend, rows: Any, places: Any, n: Any) -> Any:
    """Writes every node into each list, its planes in the order in which they are crossed."""
    node = dr.arange(backend.UInt32, dr.width(rows) // NODE_WORDS)
    words = dr.gather(backend.SingleN, rows, node, shape=(NODE_WORDS, dr.width(node)))
    size = dr.reinterpret_array(backend.UInt32, words[3])
    lists = dr.empty(type(rows), OCTANTS * dr.width(rows))
    octant = dr.zeros(backend.UInt32, dr.width(node))
    while dr.hint(octant < OCTANTS, label="octants", exclude=[backend, lists]):
        place = octant * n + dr.gather(backend.UInt32, places, octant * n + node)
        first, last = [], []
        for k in range(3):
            negative = (octant & (1 << k)) != 0
            first.append(dr.select(negative, words[4 + k], words[k]))
            last.append(dr.select(negative, words[k], words[4 + k]))
        jump = dr.reinterpret_array(type(rows), place + size)
        dr.scatter(lists, backend.SingleN([*first, jump, *last, words[7]]), place)
        octant = octant + 1
    dr.eval(lists)
    return lists


def _subtree_sizes(tree: Hierarchy) -> np.ndarray:
    """Nodes of each subtree."""
    sizes = np.ones(len(tree.left), np.int32)
    for nodes, below in reversed(_families(tree)):
        sizes[nodes] += sizes[below][0::2] + sizes[below][1::2]
    return sizes


def _places(tree: Hierarchy, sizes: np.ndarray) -> np.ndarray:
    """(n, 8) where each node stands in the list of each octant.

    Of opposite octants one meets the right child first where the other meets the left one. So its list is the
    other's read backwards, with parents before their children: n - place - size + depth.
    """
    n = len(tree.left)
    place, depth = np.zeros((n, OCTANTS), np.int32), np.zeros((n, 1), np.int32)
    negative = np.array([[octant >> k & 1 for octant in range(OCTANTS // 2)] for k in range(3)], bool)
    for nodes, below in _families(tree):
        center = (tree.lower[below] + tree.upper[below]).reshape(-1, 2, 3)
        apart = center[:, 1] - center[:, 0]
        axis = np.abs(apart).argmax(axis=1)
        left_first = (apart[np.arange(len(nodes)), axis] >= 0)[:, None] != negative[axis]
        size = sizes[below].reshape(-1, 2, 1)
        begin, children = place[nodes, : OCTANTS // 2] + 1, place[below, : OCTANTS // 2]
        children[0::2] = begin + np.where(left_first, 0, size[:, 1])
        children[1::2] = begin + np.where(left_first, size[:, 0], 0)
        depth[below] = np.repeat(depth[nodes] + 1, 2, axis=0)
    place[:, OCTANTS // 2 :] = (n - place[:, : OCTANTS // 2] - sizes[:, None] + depth)[:, ::-1]
    return place


def _families(tree: Hierarchy) -> list[tuple[np.ndarray, slice]]:
    """The inner nodes of each level that has some, and where their children lie, side by side."""
    inner = [begin + np.flatnonzero(tree.left[begin:end]) for begin, end in pairwise([0, *tree.levels])]
    return [
        (nodes, slice(end, end + 2 * len(nodes)))
        for nodes, end in zip(inner, tree.levels, strict=True)
        if len(nodes)
    ]
