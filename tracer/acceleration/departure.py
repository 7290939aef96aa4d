"""Hits close to the start of a secondary ray: coplanar neighbors, convex edges and creases of a mesh.

A ray that leaves triangle A next to an edge starts within rounding of the plane of the neighbor B: the sign of its
distance from that plane is noise. What decides then is geometry that is large compared with rounding:

* B can only be hit if it rises above the plane through the origin along A, on the side the ray travels on. A coplanar
  half of a quad and the other face of a convex edge do not.
* If B rises (a crease), the origin is on that side of B on which A itself lies: A's centroid (a sphere's center) tells.
  The ray meets B when it travels from that side towards it, at a distance that is the height above B's plane, or 0
  when rounding gave the height the wrong sign.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.acceleration.triangle import Triangle, TriangleTest
from tracer.ray import Ray, select_max


@dataclass
class Departure:
    """What a ray knows of the surface that it leaves.

    `active`: it does leave one; `primitive`: its id; `normal`: unit normal on the side of travel; `reference`: a point
    of that surface's body away from the origin, where `has_reference`; `climb`: rate at which the ray rises above
    the tangent plane.
    """

    active: Any
    primitive: Any
    normal: Any
    reference: Any
    has_reference: Any
    climb: Any


def doubtful(departure: Departure, test: TriangleTest) -> Any:
    """Mask: rounding could decide this test. Either the plane passes through the origin, or the hit lies in the
    tangent plane of the surface that the ray leaves."""
    through_origin = dr.abs(test.height) <= test.slack
    in_tangent_plane = test.within & (test.t * departure.climb <= test.slack)
    return departure.active & (through_origin | in_tangent_plane)


def meet_near_origin(
    departure: Departure, ray: Ray, triangle: Triangle, test: TriangleTest
) -> tuple[Any, Any]:
    """Distance and mask of a doubtful hit, decided as this module's header says."""
    rise = select_max(
        select_max(
            dr.dot(departure.normal, triangle.v0 - ray.o), dr.dot(departure.normal, triangle.v1 - ray.o)
        ),
        dr.dot(departure.normal, triangle.v2 - ray.o),
    )
    reference_height = dr.dot(triangle.normal, departure.reference - triangle.v0)
    through_origin = dr.abs(test.height) <= test.slack
    knows_side = through_origin & departure.has_reference & (dr.abs(reference_height) > test.slack)
    above = dr.select(knows_side, reference_height, test.height) > 0
    approaches = dr.select(above, test.speed < 0, test.speed > 0)
    inside_edges = test.within | (through_origin & test.touched)
    t = select_max(test.t, type(test.t)(0))
    return t, (rise > test.slack) & approaches & inside_edges
