"""Hits close to the start of a secondary ray: coplanar neighbors, convex edges and creases of a mesh.

A ray that leaves surface A next to triangle B starts within rounding of B's plane: the sign of its distance
from that plane is noise. What decides then is geometry that is large compared with rounding:

* B can only be hit if it rises above the plane through the origin along A, on the side the ray travels on. A
  coplanar half of a quad and the other face of a convex edge do not.
* If B rises (a crease), the origin is on that side of B on which A lies. If A reaches to both sides (a floor
  under a wall), it is on the side from which it was seen: the ray that arrived there has not crossed B.
* The ray meets B when it travels from that side towards it, at its distance from B's plane, or at 0 when
  rounding gave the distance the wrong sign.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.acceleration.triangle import Triangle, TriangleTest
from tracer.ray import Ray, largest, max_abs, select_max


@dataclass
class Ground:
    """Where a surface lies: within `reach` of three points (a triangle: its `corners` and 0; a sphere: center
    and radius; a plane: infinite)."""

    corners: tuple[Any, ...]
    reach: Any


@dataclass
class Departure:
    """What a ray knows of the surface that it leaves.

    `active`: it does leave one; `primitive`: its id; `normal`: unit normal on the side of travel; `ground`:
    looks up where the surface lies, which few rays ask; `view`: direction towards where the origin was seen
    from; `climb`: rate at which the ray rises above the tangent plane.
    """

    active: Any
    primitive: Any
    normal: Any
    ground: Callable[[], Ground]
    view: Any
    climb: Any


def doubtful(departure: Departure, test: TriangleTest) -> Any:
    """Mask: rounding could decide this test. Either the plane passes through the origin, or the hit lies in
    the tangent plane of the surface that the ray leaves."""
    through_origin = dr.abs(test.height) <= test.slack
    in_tangent_plane = test.touched & (test.t * departure.climb <= test.slack)
    return departure.active & (through_origin | in_tangent_plane)


def may_be_doubtful(departure: Departure, test: TriangleTest, rounding: Any) -> Any:
    """Mask: `doubtful` may say so; cheaper, with a bound on every triangle's rounding."""
    # Planes behind the ray are no matter: `meet_near_origin` never accepts them.
    in_tangent_plane = dr.abs(test.t) * departure.climb <= rounding
    return departure.active & ((dr.abs(test.height) <= rounding) | in_tangent_plane)


def meet_near_origin(
    departure: Departure, ray: Ray, triangle: Triangle, test: TriangleTest
) -> tuple[Any, Any]:
    """Distance and mask of a doubtful hit, decided as this module's header says."""
    rise = largest(dr.dot(departure.normal, v - ray.o) for v in (triangle.v0, triangle.v1, triangle.v2))
    through_origin = dr.abs(test.height) <= test.slack
    above = dr.select(through_origin, _side(departure, triangle, test), test.height) > 0
    approaches = dr.select(above, test.speed < 0, test.speed > 0)
    t = select_max(test.t, type(test.t)(0))
    # Through the origin the distance is known to slack / |speed| only: either end of that stretch may be
    # the hit.
    far = t + 2 * test.slack / dr.abs(test.speed)
    meets = _within_edges(triangle, dr.fma(t, ray.d, ray.o), test.slack) | (
        through_origin & _within_edges(triangle, dr.fma(far, ray.d, ray.o), test.slack)
    )
    return t, (rise > test.slack) & approaches & test.touched & meets


def _within_edges(triangle: Triangle, p: Any, slack: Any) -> Any:
    """Mask: a point of the triangle's plane lies inside its edges, or outside by no more than the slack.

    Measured in that plane: seen along a ray that almost lies in it, the triangle is too thin to tell.
    """
    corners = (triangle.v0, triangle.v1, triangle.v2)
    inside = None
    for start, end in zip(corners, (*corners[1:], corners[0]), strict=True):
        edge = end - start
        beyond = dr.dot(dr.cross(triangle.normal, edge), p - start)
        near = beyond >= -slack * dr.sqrt(dr.squared_norm(edge))
        inside = near if inside is None else inside & near
    return inside


def _side(departure: Departure, triangle: Triangle, test: TriangleTest) -> Any:
    """Positive where the surface that is left lies on the positive side of the triangle's plane, or is seen
    from it."""
    ground = departure.ground()
    offsets = [corner - triangle.v0 for corner in ground.corners]
    heights = [dr.dot(triangle.normal, offset) for offset in offsets]
    low = -largest(-height for height in heights) - ground.reach
    high = largest(heights) + ground.reach
    slack = select_max(test.slack, test.relative_slack * largest(max_abs(offset) for offset in offsets))
    one_sided = (low >= -slack) | (high <= slack)
    return dr.select(one_sided, low + high, dr.dot(triangle.normal, departure.view))
