"""The hierarchy as kernels walk it: threaded, and laid out eight times, once for every octant of directions.

A copy lists the nodes depth first, the child that rays of its octant meet first before the other. A ray that
meets a node's box goes on with the next node of the list, a ray that misses it jumps over the whole subtree:
no stack. Planes are stored in the order in which those rays cross them (Smits, Efficiency Issues for Ray
Tracing, 1998).
"""

from __future__ import annotations

import numpy as np

from tracer.acceleration.build import Hierarchy

NODE_WORDS = 8
"""Words of 32 bits of a node: three planes crossed first, where to jump, three planes crossed last, and for a
leaf its first triangle slot times 8 plus their number, else 0."""

OCTANTS = 8
"""Octant o holds the directions whose component k is negative where bit k of o is set."""


def threaded(tree: Hierarchy) -> np.ndarray:
    """(8 n, NODE_WORDS) float32, some words of which are bit patterns of unsigned integers."""
    n = len(tree.left)
    sizes = _subtree_sizes(tree)
    is_leaf = tree.left == 0
    leaf = np.where(is_leaf, tree.first << 3 | tree.count, 0).astype(np.uint32)
    words = np.empty((OCTANTS, n, NODE_WORDS), np.float32)
    bits = words.view(np.uint32)
    for octant in range(OCTANTS):
        negative = np.array([octant >> k & 1 for k in range(3)], bool)
        place = _places(tree, sizes, negative)
        words[octant, place, 0:3] = np.where(negative, tree.upper, tree.lower)
        words[octant, place, 4:7] = np.where(negative, tree.lower, tree.upper)
        bits[octant, place, 3] = octant * n + place + sizes
        bits[octant, place, 7] = leaf
    return words.reshape(OCTANTS * n, NODE_WORDS)


def _subtree_sizes(tree: Hierarchy) -> np.ndarray:
    """Nodes of each subtree."""
    sizes = np.ones(len(tree.left), np.int64)
    for begin, end in _levels_bottom_up(tree):
        nodes = begin + np.flatnonzero(tree.left[begin:end])
        sizes[nodes] += sizes[tree.left[nodes]] + sizes[tree.left[nodes] + 1]
    return sizes


def _places(tree: Hierarchy, sizes: np.ndarray, negative: np.ndarray) -> np.ndarray:
    """Where each node stands in the list of an octant."""
    center = tree.lower + tree.upper
    place = np.zeros(len(tree.left), np.int64)
    for begin, end in reversed(_levels_bottom_up(tree)):
        nodes = begin + np.flatnonzero(tree.left[begin:end])
        left, right = tree.left[nodes], tree.left[nodes] + 1
        apart = center[right] - center[left]
        axis = np.abs(apart).argmax(axis=1)
        left_first = (apart[np.arange(len(nodes)), axis] >= 0) != negative[axis]
        near, far = np.where(left_first, left, right), np.where(left_first, right, left)
        place[near] = place[nodes] + 1
        place[far] = place[nodes] + 1 + sizes[near]
    return place


def _levels_bottom_up(tree: Hierarchy) -> list[tuple[int, int]]:
    return list(zip([0, *tree.levels[:-1]], tree.levels, strict=True))[::-1]
