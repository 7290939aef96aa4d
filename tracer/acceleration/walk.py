"""The walk through the hierarchy that rays, beams and bundles share, without a stack.

The nodes stand in a list for every octant of directions (`layout.py`). A lane goes on to the next node where
it meets a box, and jumps where it misses one. Nodes and leaves take turns: lanes without anything to test
take a few steps through the list, then all lanes that have something test one thing. So no lane waits
until its neighbors are done with a long leaf (measured: a third faster for incoherent rays than one inner
loop for each).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.acceleration.layout import FLOAT_WORDS, LEAF, NodeLists
from tracer.backends import Backend
from tracer.branches import changed_where

STRIDE = 3
"""Steps between two tests, for rays. 2 and 4 are slower by some percent."""


@dataclass
class Node:
    """n nodes: the planes that directions of an octant cross `first` and `last` (3, n), in units of the
    lists, and the `link` (see `layout.LEAF`)."""

    first: Any
    last: Any
    link: Any


def fetch_node(backend: Backend, lists: NodeLists, node: Any) -> Node:
    """Reads nodes from the lists."""
    vector = backend.Vector3
    if lists.grid is not None:
        words = dr.gather(backend.IdVector4, lists.words, node)
        first = vector(*(backend.Float(words[k] & 0xFFFF) for k in range(3)))
        return Node(first, vector(*(backend.Float(words[k] >> 16) for k in range(3))), words[3])
    words = dr.gather(backend.IdN, lists.words, node, shape=(FLOAT_WORDS, dr.width(node)))
    single = dr.value_t(backend.SingleN)
    first, last = (vector(*(dr.reinterpret_array(single, words[k + i]) for i in range(3))) for k in (0, 4))
    return Node(first, last, words[3])


def octant_of(backend: Backend, d: Any) -> Any:
    """Number of the octant of directions (3, n): bit k is set where component k is negative."""
    octant = backend.UInt32(0)
    for k, component in enumerate(d):
        octant = octant | dr.select(component < 0, backend.UInt32(1 << k), 0)
    return octant


def within_root(
    backend: Backend,
    lists: NodeLists,
    octant: Any,
    crosses: Callable[[Node, Any], Any],
    active: Any,
    state: Any,
    change: Callable[[Any], Any],
) -> Any:
    """change(state) where the root's box is crossed, the state elsewhere. Packets that miss it compute
    nothing of the change: neither the walk nor what only the walk needs."""
    root = fetch_node(backend, lists, octant * lists.count)
    return changed_where(active & crosses(root, state), state, change, label="root")


def walk(
    backend: Backend,
    lists: NodeLists,
    octant: Any,
    crosses: Callable[[Node, Any], Any],
    test: Callable[[Any, Any], Any],
    state: Any,
    done: Callable[[Any], Any] | None = None,
    stride: int = STRIDE,
) -> Any:
    """Folds what lies in the leaves on the way into a state.

    `crosses(node, state)`: mask, goes into the node; `test(slot, state)`: the next state; `done(state)`:
    mask, ends the walk; `stride`: steps between two tests.
    """
    begin = octant * lists.count
    end = begin + lists.count

    # A lane's leaf is 0 or counts down: LEAF + 8 slot + how many are left.
    def step(node: Any, leaf: Any, state: Any) -> tuple[Any, Any]:
        fetched = fetch_node(backend, lists, node)
        walks = ((leaf & 7) == 0) & (node < end)
        crossed = walks & crosses(fetched, state)
        is_leaf = fetched.link >= LEAF
        goes_on = dr.select(crossed | is_leaf, node + 1, fetched.link)
        return dr.select(walks, goes_on, node), dr.select(crossed & is_leaf, fetched.link, leaf)

    def test_one(leaf: Any, state: Any) -> tuple[Any, Any]:
        return leaf + 7, test((leaf & (LEAF - 1)) >> 3, state)

    def body(node: Any, leaf: Any, state: Any) -> tuple[Any, Any, Any]:
        for _ in range(stride):
            node, leaf = step(node, leaf, state)
        leaf, state = dr.if_stmt(
            args=(leaf, state),
            cond=(leaf & 7) != 0,
            true_fn=test_one,
            false_fn=lambda leaf, state: (leaf, state),
            label="leaf",
        )
        if done is not None:
            finished = done(state)
            node, leaf = dr.select(finished, end, node), dr.select(finished, 0, leaf)
        return node, leaf, state

    none = dr.zeros(backend.UInt32, dr.width(octant))
    *_, state = dr.while_loop(
        state=(begin + none, none, state),
        cond=lambda node, leaf, state: (node < end) | ((leaf & 7) != 0),
        body=body,
        label="hierarchy",
    )
    return state


def walk_within_root(
    backend: Backend,
    lists: NodeLists,
    octant: Any,
    crosses: Callable[[Node, Any], Any],
    test: Callable[[Any, Any], Any],
    active: Any,
    state: Any,
    done: Callable[[Any], Any] | None = None,
) -> Any:
    """`walk` where the root's box is crossed, the state elsewhere."""
    return within_root(
        backend,
        lists,
        octant,
        crosses,
        active,
        state,
        lambda state: walk(backend, lists, octant, crosses, test, state, done),
    )
