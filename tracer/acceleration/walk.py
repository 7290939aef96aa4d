"""The walk through the hierarchy that rays and beams share, without a stack.

The nodes stand in a list for every octant of directions (`layout.py`). A lane goes on to the next node where
it meets a box, and jumps where it misses one. Nodes and triangles take turns: lanes without triangles to
test take one step through the list, then all lanes that have one test one triangle. So no lane waits until
its neighbors are done with a long leaf (measured: a third faster for incoherent rays than one inner loop for
each).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.acceleration.layout import NODE_WORDS
from tracer.acceleration.triangle import Triangle, fetch_triangle
from tracer.backends import Backend


@dataclass
class TriangleTables:
    """All triangles of a scene and the tree over them, in Dr.Jit memory.

    `triangles`: `TRIANGLE_WORDS` words each, in the order of the leaves; `nodes`: eight lists of `count`
    (width 1) nodes, `NODE_WORDS` words each; `extent` (width 1): the largest |coordinate|.
    """

    triangles: Any
    nodes: Any
    count: Any
    extent: Any


@dataclass
class Node:
    """n nodes: the planes that directions of an octant cross `first` and `last` (3, n), the node to `jump`
    to, and the word of a `leaf` (first slot times 8 plus triangles), 0 for others."""

    first: Any
    last: Any
    jump: Any
    leaf: Any


def fetch_node(backend: Backend, tables: TriangleTables, node: Any) -> Node:
    """Reads nodes from the table."""
    words = dr.gather(backend.SingleN, tables.nodes, node, shape=(NODE_WORDS, dr.width(node)))
    vector, word = backend.Vector3, backend.UInt32
    return Node(
        first=vector(words[0], words[1], words[2]),
        last=vector(words[4], words[5], words[6]),
        jump=dr.reinterpret_array(word, words[3]),
        leaf=dr.reinterpret_array(word, words[7]),
    )


def octant_of(backend: Backend, d: Any) -> Any:
    """Number of the octant of directions (3, n): bit k is set where component k is negative."""
    octant = backend.UInt32(0)
    for k, component in enumerate(d):
        octant = octant | dr.select(component < 0, backend.UInt32(1 << k), 0)
    return octant


def walk(
    backend: Backend,
    tables: TriangleTables,
    octant: Any,
    crosses: Callable[[Node, Any], Any],
    test: Callable[[Triangle, Any, Any], Any],
    done: Callable[[Any], Any],
    state: Any,
) -> Any:
    """Folds the triangles of all leaves on the way into a state.

    `crosses(node, state)`: mask, goes into the node; `test(triangle, primitive id, state)`: the next state;
    `done(state)`: mask, ends the walk.
    """
    begin = octant * tables.count
    end = begin + tables.count

    def step(node: Any, slot: Any, last: Any, state: Any) -> tuple[Any, Any, Any]:
        idle = (slot == last) & (node < end)
        fetched = fetch_node(backend, tables, dr.select(idle, node, begin))
        crossed, leaf = idle & crosses(fetched, state), fetched.leaf
        slot = dr.select(crossed & (leaf != 0), leaf >> 3, slot)
        last = dr.select(crossed & (leaf != 0), (leaf >> 3) + (leaf & 7), last)
        return dr.select(idle, dr.select(crossed & (leaf == 0), node + 1, fetched.jump), node), slot, last

    def test_one(slot: Any, state: Any) -> tuple[Any, Any]:
        return slot + 1, test(*fetch_triangle(backend, tables.triangles, slot), state)

    def body(node: Any, slot: Any, last: Any, state: Any) -> tuple[Any, Any, Any, Any]:
        node, slot, last = step(node, slot, last, state)
        slot, state = dr.if_stmt(
            args=(slot, state),
            cond=slot < last,
            true_fn=test_one,
            false_fn=lambda slot, state: (slot, state),
            label="triangle",
        )
        finished = done(state)
        return dr.select(finished, end, node), dr.select(finished, last, slot), last, state

    none = dr.zeros(backend.UInt32, dr.width(octant))
    *_, state = dr.while_loop(
        state=(begin + none, none, none + 0, state),
        cond=lambda node, slot, last, state: (node < end) | (slot < last),
        body=body,
        label="hierarchy",
    )
    return state
