"""The walk through the hierarchy that rays, beams and bundles share, without a stack.

The nodes stand in a list for every octant of directions (`layout.py`). A lane goes on to the next node where
it meets a box, and jumps where it misses one. Nodes and leaves take turns: all lanes take a few steps through
the list, then those that have found something test one thing. So no lane waits until its neighbors are done
with a long leaf (measured: a third faster for incoherent rays than one inner loop for each). And a lane with
something to test does not stand still: it may find one more leaf before it waits. So more lanes have
something to test when tests come, and there are fewer of them (a tenth faster).
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

    # A leaf counts down: LEAF + 8 slot + how many are left to test. `leaf` is the one under test, `later` the
    # next one, 0 for none.
    def step(node: Any, leaf: Any, later: Any, state: Any) -> tuple[Any, Any, Any]:
        fetched = fetch_node(backend, lists, node)
        walks = (later == 0) & (node < end)
        crossed = walks & crosses(fetched, state)
        is_leaf = fetched.link >= LEAF
        goes_on = dr.select(crossed | is_leaf, node + 1, fetched.link)
        found, free = crossed & is_leaf, (leaf & 7) == 0
        return (
            dr.select(walks, goes_on, node),
            dr.select(found & free, fetched.link, leaf),
            dr.select(found & ~free, fetched.link, later),
        )

    def test_one(leaf: Any, state: Any) -> tuple[Any, Any]:
        return leaf + 7, test((leaf & (LEAF - 1)) >> 3, state)

    def body(node: Any, leaf: Any, later: Any, state: Any) -> tuple[Any, Any, Any, Any]:
        for _ in range(stride):
            node, leaf, later = step(node, leaf, later, state)
        leaf, state = dr.if_stmt(
            args=(leaf, state),
            cond=(leaf & 7) != 0,
            true_fn=test_one,
            false_fn=lambda leaf, state: (leaf, state),
            label="leaf",
        )
        tested = (leaf & 7) == 0
        leaf, later = dr.select(tested, later, leaf), dr.select(tested, 0, later)
        if done is not None:
            nothing = backend.UInt32(0)
            node, leaf, later = dr.select(done(state), (end, nothing, nothing), (node, leaf, later))
        return node, leaf, later, state

    none = dr.zeros(backend.UInt32, dr.width(octant))
    *_, state = dr.while_loop(
        state=(begin + none, none, none, state),
        cond=lambda node, leaf, later, state: (node < end) | ((leaf & 7) != 0),
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
