"""Visits the triangles that rays meet, nearest boxes first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.acceleration.departure import Departure, doubtful, meet_near_origin
from tracer.acceleration.triangle import Triangle, TriangleTest, meet_triangle, projection_axes
from tracer.acceleration.walk import Node, TriangleTables, fetch_node, octant_of, walk
from tracer.backends import Backend
from tracer.ray import Ray, max_abs, select_max, select_min

SMALLEST_COMPONENT = 1e-20
"""Direction components below this count as this: their reciprocal stays finite, the ray moves by 1e-20 of its
way."""

GRAZING = 0.25
"""Hits at a smaller cosine than this stay within the box of their triangle. At larger ones the rounding of
the distance is of the size by which boxes are widened; keeping all hits costs 4 % of a ray, twice as much."""

Visit = Callable[[Any, Any, Any, TriangleTest, Any], Any]
"""(state, distance, primitive id, the whole test, mask of a hit in front of the limit) -> state."""


def visit_triangles(
    backend: Backend,
    tables: TriangleTables,
    ray: Ray,
    departure: Callable[[], Departure],
    state: Any,
    limit: Callable[[Any], Any],
    visit: Visit,
    active: Any,
) -> Any:
    """Calls `visit` for every triangle met, until the walk ends or `limit(state)` (a distance) falls below
    zero. What only rays that enter the root's box need, `departure()` too, is not computed for packets
    without one."""
    slabs = _Slabs.of(backend, tables, ray)
    root = fetch_node(backend, tables, slabs.octant * tables.count)

    def visit_all(state: Any) -> tuple[Any]:
        axes, leaving = projection_axes(ray.d), departure()

        def test(triangle: Triangle, primitive: Any, state: Any) -> Any:
            found = meet_triangle(backend.epsilon, triangle, ray, axes)
            other = ~(leaving.active & (leaving.primitive == primitive))
            t, valid = _decide(leaving, ray, triangle, found, other & doubtful(leaving, found))
            valid = valid & other
            t, valid = _in_own_box(slabs, triangle, t, valid, valid & (dr.abs(found.speed) < GRAZING))
            return visit(state, t, primitive, found, valid & (t <= limit(state)))

        return (
            walk(
                backend,
                tables,
                slabs.octant,
                crosses=lambda node, state: slabs.crossed(node, limit(state)),
                test=test,
                done=lambda state: limit(state) < 0,
                state=state,
            ),
        )

    (state,) = dr.if_stmt(
        args=(state,),
        cond=active & slabs.crossed(root, limit(state)),
        true_fn=visit_all,
        false_fn=lambda state: (state,),
        label="root",
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


def _in_own_box(slabs: _Slabs, triangle: Triangle, t: Any, valid: Any, grazing: Any) -> tuple[Any, Any]:
    """Distance and mask of hits, those at a grazing angle kept within the box of their own triangle.

    The distance along a plane that the ray all but lies in is noise. Let it leave the box, and it would
    depend on the tree whether the triangle is tested before a nearer hit prunes it. Boxes around it are
    entered no later: rounding is monotonic.
    """

    def kept(t: Any, valid: Any) -> tuple[Any, Any]:
        entry, leave = slabs.own_span(triangle)
        return select_max(select_min(t, leave), entry), valid & (entry <= leave)

    t, valid = dr.if_stmt(
        args=(t, valid),
        cond=grazing,
        true_fn=kept,
        false_fn=lambda t, valid: (t, valid),
        rv_labels=("t", "valid"),
        label="grazing",
    )
    return t, valid


@dataclass
class _Slabs:
    """A ray prepared for box tests: its octant, its reciprocal direction, and the distances to planes through
    zero for those crossed first and last, moved by the bound on all rounding.

    The triangle test may accept a line that misses the exact triangle by the rounding of the corners seen
    from the origin; so every box is widened by 8 eps times the largest coordinate in play.
    """

    octant: Any
    inverse: Any
    shift_first: Any
    shift_last: Any

    @staticmethod
    def of(backend: Backend, tables: TriangleTables, ray: Ray) -> _Slabs:
        tiny = backend.Float(SMALLEST_COMPONENT)
        d = backend.Vector3(*(dr.select(dr.abs(c) < tiny, dr.select(c < 0, -tiny, tiny), c) for c in ray.d))
        inverse = dr.rcp(d)
        pad = 8 * backend.epsilon * (max_abs(ray.o) + tables.extent) * dr.abs(inverse)
        shift = -ray.o * inverse
        return _Slabs(octant_of(backend, d), inverse, shift - pad, shift + pad)

    def crossed(self, node: Node, limit: Any) -> Any:
        """Mask: the ray meets the widened box of the node in 0 <= t <= limit (Kay and Kajiya, 1986)."""
        entry, leave = self.span(node.first, node.last, limit)
        return entry <= leave

    def span(self, first: Any, last: Any, limit: Any) -> tuple[Any, Any]:
        """Where the ray enters and leaves the widened box between planes crossed first and last, within 0
        and limit."""
        near = dr.fma(first, self.inverse, self.shift_first)
        far = dr.fma(last, self.inverse, self.shift_last)
        entry = select_max(select_max(near.x, near.y), select_max(near.z, type(near.z)(0)))
        return entry, select_min(select_min(far.x, far.y), select_min(far.z, limit))

    def own_span(self, triangle: Triangle) -> tuple[Any, Any]:
        """The span of the box of triangles."""
        first, last = [], []
        for k, (a, b, c) in enumerate(zip(triangle.v0, triangle.v1, triangle.v2, strict=True)):
            low, high = select_min(select_min(a, b), c), select_max(select_max(a, b), c)
            negative = (self.octant & (1 << k)) != 0
            first.append(dr.select(negative, high, low))
            last.append(dr.select(negative, low, high))
        vector = type(triangle.v0)
        return self.span(vector(*first), vector(*last), type(triangle.v0.x)(dr.inf))
