"""Visits the triangles whose boxes a ray crosses: without a stack, since the tree is complete.

After node i comes its left child 2i if the box was hit, else the next subtree: i + 1 with its trailing zeros
stripped (the right sibling of the lowest ancestor that is a left child); back at 1 the walk is over.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.acceleration.build import LEAF_SLOTS
from tracer.acceleration.departure import Departure, doubtful, meet_near_origin
from tracer.acceleration.triangle import (
    Triangle,
    TriangleTest,
    gather_triangle,
    meet_triangle,
    projection_axes,
)
from tracer.backends import INVALID, Backend
from tracer.ray import Ray, max_abs, select_max, select_min

SMALLEST_COMPONENT = 1e-20
"""Direction components below this count as this: their reciprocal stays finite, the ray moves by 1e-20 of its
way."""


@dataclass
class TriangleTables:
    """All triangles of a scene and the tree over them, in Dr.Jit memory.

    `triangles`: `TRIANGLE_WORDS` floats each, in file order; `boxes`: 8 floats a node; `order`: triangle of
    each leaf slot; `primitive`: id of each triangle; `leaf_count`, `extent` (largest |coordinate|): width-1.
    """

    triangles: Any
    boxes: Any
    order: Any
    primitive: Any
    leaf_count: Any
    extent: Any


Visit = Callable[[Any, Any, Any, TriangleTest, Any], Any]
"""(state, distance, primitive id, the whole test, mask of a hit in front of the limit) -> state."""


def visit_triangles(
    backend: Backend,
    tables: TriangleTables,
    ray: Ray,
    departure: Departure,
    state: Any,
    limit: Callable[[Any], Any],
    visit: Visit,
    active: Any,
) -> Any:
    """Calls `visit` for every triangle met, until the walk ends or `limit(state)` (a distance) falls below
    zero."""
    slabs = _Slabs.of(backend, tables, ray)
    axes = projection_axes(ray.d)

    def leaf(node: Any, state: Any) -> Any:
        slot = (node - tables.leaf_count) * LEAF_SLOTS
        previous = backend.UInt32(INVALID)
        for k in range(LEAF_SLOTS):
            index = dr.gather(backend.UInt32, tables.order, slot + k)
            fresh, previous = index != previous, index  # a leaf with one triangle holds it twice
            triangle = gather_triangle(backend, tables.triangles, index, True)
            primitive = dr.gather(backend.UInt32, tables.primitive, index)
            test = meet_triangle(backend.epsilon, triangle, ray, axes)
            other = ~(departure.active & (departure.primitive == primitive))
            t, valid = _decide(departure, ray, triangle, test, other & doubtful(departure, test))
            state = visit(state, t, primitive, test, valid & other & fresh & (t <= limit(state)))
        return state

    def body(node: Any, state: Any) -> tuple[Any, Any]:
        crossed = slabs.crossed(backend, tables, node, limit(state))
        at_leaf = node >= tables.leaf_count
        (state,) = dr.if_stmt(
            args=(node, state),
            cond=crossed & at_leaf,
            true_fn=lambda node, state: (leaf(node, state),),
            false_fn=lambda node, state: (state,),
            label="leaf",
        )
        following = node + 1
        following = following >> dr.tzcnt(following)
        following = dr.select(following == 1, 0, following)
        node = dr.select(crossed & ~at_leaf, node << 1, following)
        return dr.select(limit(state) < 0, 0, node), state

    node = dr.select(active, backend.UInt32(1), 0) & dr.full(backend.UInt32, INVALID, dr.width(ray.o))
    _, state = dr.while_loop(
        state=(node, state), cond=lambda node, state: node != 0, body=body, label="hierarchy"
    )
    return state


def _decide(
    departure: Departure, ray: Ray, triangle: Triangle, test: TriangleTest, doubts: Any
) -> tuple[Any, Any]:
    """Distance and mask of a hit; a branch for the few that rounding could decide wrongly."""

    def doubtful_hit(t: Any, valid: Any) -> tuple[Any, Any]:
        return meet_near_origin(departure, ray, triangle, test)

    def clear_hit(t: Any, valid: Any) -> tuple[Any, Any]:
        return t, valid

    t, valid = dr.if_stmt(
        args=(test.t, test.within & (test.t > 0)),
        cond=doubts,
        true_fn=doubtful_hit,
        false_fn=clear_hit,
        rv_labels=("t", "valid"),
        label="near the origin",
    )
    return t, valid


@dataclass
class _Slabs:
    """A ray prepared for box tests: reciprocal direction, and its origin moved by the bound on all rounding.

    The triangle test may accept a line that misses the exact triangle by the rounding of the corners seen
    from the origin; so every box is widened by 8 eps times the largest coordinate in play.
    """

    inverse: Any
    origin_low: Any
    origin_high: Any

    @staticmethod
    def of(backend: Backend, tables: TriangleTables, ray: Ray) -> _Slabs:
        tiny = backend.Float(SMALLEST_COMPONENT)
        d = backend.Vector3(*(dr.select(dr.abs(c) < tiny, dr.select(c < 0, -tiny, tiny), c) for c in ray.d))
        pad = 8 * backend.epsilon * (max_abs(ray.o) + tables.extent)
        return _Slabs(dr.rcp(d), ray.o + pad, ray.o - pad)

    def crossed(self, backend: Backend, tables: TriangleTables, node: Any, limit: Any) -> Any:
        """Mask: the ray meets the widened box of the node in 0 <= t <= limit (Kay and Kajiya, 1986)."""
        low = dr.gather(backend.Vector4, tables.boxes, node * 2)
        high = dr.gather(backend.Vector4, tables.boxes, node * 2 + 1)
        a = (backend.Vector3(low.x, low.y, low.z) - self.origin_low) * self.inverse
        b = (backend.Vector3(high.x, high.y, high.z) - self.origin_high) * self.inverse
        near = select_max(select_max(select_min(a.x, b.x), select_min(a.y, b.y)), select_min(a.z, b.z))
        far = select_min(select_min(select_max(a.x, b.x), select_max(a.y, b.y)), select_max(a.z, b.z))
        return select_max(near, backend.Float(0)) <= select_min(far, limit)
