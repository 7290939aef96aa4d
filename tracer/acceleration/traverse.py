"""Visits the triangles that rays meet, nearest boxes first."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr

from tracer.acceleration.departure import Departure, doubtful, may_be_doubtful, meet_near_origin
from tracer.acceleration.layout import NodeLists
from tracer.acceleration.slabs import Slabs
from tracer.acceleration.triangle import (
    Triangle,
    TriangleTables,
    TriangleTest,
    fetch_triangle,
    largest_slack,
    meet_triangle,
    projection_axes,
)
from tracer.acceleration.walk import Node, walk, within_root
from tracer.backends import Backend
from tracer.branches import changed_where
from tracer.ray import Ray, select_max, select_min

GRAZING = 0.25
"""Hits at a smaller cosine than this stay within the box of their triangle. At larger ones the rounding of
the distance is of the size by which boxes are widened; keeping all hits costs 4 % of a ray, twice as much."""

Visit = Callable[[Any, Any, Any, TriangleTest, Any], Any]
"""(state, distance, primitive id, the whole test, mask of a hit in front of the limit) -> state."""


Test = Callable[[Any, Any], Any]
"""(slot of a triangle, state) -> state."""

Fold = Callable[[Test, Any], Any]
"""(test, state) -> the state after all tests."""


def visit_triangles(
    backend: Backend,
    tables: TriangleTables,
    ray: Ray,
    departure: Callable[[], Departure],
    state: Any,
    limit: Callable[[Any], Any],
    visit: Visit,
    active: Any,
    light: Any = None,
    done: Callable[[Any], Any] | None = None,
    among: Fold | None = None,
) -> Any:
    """Calls `visit` for every triangle met, until the walk ends or `done(state)` says so.

    `limit(state)`: the distance up to which hits count; `light`: distance of a light at the end of the ray,
    which no triangle hides in whose plane it lies. What only rays that enter the root's box need,
    `departure()` too, is not computed for packets without one. `among`: in place of the walk, takes a state
    through the tests of the slots of some triangles that are known beforehand, all of them.
    """

    def test_within(slabs: Slabs) -> Test:
        return _test(backend, tables, ray, slabs, departure(), limit, visit, light)

    if among is not None:

        def visit_some(state: Any) -> Any:
            return among(test_within(Slabs.of(backend, tables.lists, ray)), state)

        return changed_where(active, state, visit_some, label="some")

    slabs = Slabs.of(backend, tables.lists, ray)

    def crosses(node: Node, state: Any) -> Any:
        return slabs.crossed(node, limit(state))

    def visit_all(state: Any) -> Any:
        return walk(backend, tables.lists, slabs.octant, crosses, test_within(slabs), state, done)

    return within_root(backend, tables.lists, slabs.octant, crosses, active, state, visit_all)


def _test(
    backend: Backend,
    tables: TriangleTables,
    ray: Ray,
    slabs: Slabs,
    leaving: Departure,
    limit: Callable[[Any], Any],
    visit: Visit,
    light: Any,
) -> Test:
    """The test of the triangle in a slot."""
    axes = projection_axes(ray.d)
    rounding = largest_slack(backend.epsilon, ray.o, tables.lists.extent)

    def test(slot: Any, state: Any) -> Any:
        triangle, primitive = fetch_triangle(backend, tables.rows, slot)
        found = meet_triangle(backend.epsilon, triangle, ray, axes)
        other = ~(leaving.active & (leaving.primitive == primitive))
        met = found.within & (found.t > 0)
        special = (met & (dr.abs(found.speed) < GRAZING)) | may_be_doubtful(leaving, found, rounding)
        if light is not None:
            special = special | (met & (dr.abs(_height_of(light, found)) <= rounding))

        def with_care(t: Any, valid: Any) -> tuple[Any, Any]:
            t, valid = dr.select(
                other & doubtful(leaving, found),
                meet_near_origin(leaving, ray, triangle, found),
                (t, valid),
            )
            t, valid = dr.select(
                dr.abs(found.speed) < GRAZING, _in_own_box(slabs, ray, triangle, t, valid), (t, valid)
            )
            if light is not None:
                valid = valid & (dr.abs(_height_of(light, found)) > found.slack)
            return t, valid

        t, valid = dr.if_stmt(
            args=(found.t, met),
            cond=special,
            true_fn=with_care,
            false_fn=lambda t, valid: (t, valid),
            rv_labels=("t", "valid"),
            label="near the origin, grazing, or a light on the plane",
        )
        return visit(state, t, primitive, found, valid & other & (t <= limit(state)))

    return test


def distance_to(backend: Backend, lists: NodeLists, ray: Ray, triangle: Triangle) -> Any:
    """Distance (n,) of a triangle that a ray is known to meet, and that it does not leave: to the last bit
    what `visit_triangles` finds."""
    found = meet_triangle(backend.epsilon, triangle, ray, projection_axes(ray.d))

    def within_box(t: Any) -> Any:
        return _in_own_box(Slabs.of(backend, lists, ray), ray, triangle, t, True)[0]

    return changed_where(dr.abs(found.speed) < GRAZING, found.t, within_box, label="grazing")


def _height_of(light: Any, test: TriangleTest) -> Any:
    """Signed distance of a light from the triangle's plane."""
    return dr.fma(light, test.speed, test.height)


def _in_own_box(slabs: Slabs, ray: Ray, triangle: Triangle, t: Any, valid: Any) -> tuple[Any, Any]:
    """Distance and mask of hits at a grazing angle, kept within the box of their own triangle.

    The distance along a plane that the ray all but lies in is noise. Let it leave the box, and it would
    depend on the tree whether the triangle is tested before a nearer hit prunes it. Boxes around it are
    entered no later: they are wider by more than rounding (`OWN_WIDTH`, `WIDTH`).
    """
    entry, leave = slabs.own_span(ray, triangle)
    return select_max(select_min(t, leave), entry), valid & (entry <= leave)
