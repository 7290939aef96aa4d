"""Ray against triangle: watertight, and safe for rays that start on a neighboring triangle.

Inside test: the corners, relative to the origin, are projected along the ray onto two axes; the three edge
functions of the projected triangle decide (Woop, Benthin, Wald, Watertight Ray/Triangle Intersection, JCGT
2013). Two triangles that share a corner project it to the same two numbers, and the sign of an edge function
a b - c d is computed without error (Kahan's difference of products), so a ray that is aimed at a shared edge
or corner cannot pass between them. The distance comes from the plane of the triangle, whose unit normal was
made in double precision.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.backends import Backend
from tracer.ray import Ray, max_abs, select_max, select_min

TRIANGLE_WORDS = 16
"""Floats of a triangle in its table: three corners, unit normal (zero: degenerate, never hit), two halves of
its primitive id (whole numbers below 2^16, exact in single precision), 2 unused."""

CONTACT_SLACK = 32
"""Bound on the error of a hit point, in units of eps S: 8 across its surface, and up to 4 times that along it
when the ray arrived at a slant (cosine above 1/4). A generous bound costs nothing, since what it admits is
decided by geometry."""


@dataclass
class Triangle:
    """n triangles: corners and unit geometric normal, each (3, n)."""

    v0: Any
    v1: Any
    v2: Any
    normal: Any


@dataclass
class Projection:
    """Axes across the ray: `u`, `v` unit length and orthogonal to `d`; the same for every triangle."""

    u: Any
    v: Any


def gather_triangle(backend: Backend, table: Any, slot: Any) -> Triangle:
    """The triangle in a slot of the hierarchy (or its vertex normals, from a table of the same layout)."""
    return fetch_triangle(backend, table, slot)[0]


def fetch_triangle(backend: Backend, table: Any, slot: Any) -> tuple[Triangle, Any]:
    """The triangle in a slot of the hierarchy, and its primitive id."""
    # Packets have 8 words at most.
    a, b = (dr.gather(backend.FloatN, table, slot * 2 + k, shape=(8, dr.width(slot))) for k in range(2))
    vector = backend.Vector3
    triangle = Triangle(
        vector(a[0], a[1], a[2]), vector(a[3], a[4], a[5]), vector(a[6], a[7], b[0]), vector(b[1], b[2], b[3])
    )
    return triangle, (backend.UInt32(b[4]) << 16) | backend.UInt32(b[5])


def projection_axes(d: Any) -> Projection:
    """Two axes orthogonal to d, without a branch (Duff et al., Building an Orthonormal Basis, Revisited,
    2017)."""
    vector = type(d)
    sign = dr.select(d.z >= 0, type(d.z)(1), type(d.z)(-1))
    a = -dr.rcp(sign + d.z)
    b = d.x * d.y * a
    u = vector(dr.fma(sign * a, d.x * d.x, 1), sign * b, -sign * d.x)
    v = vector(b, dr.fma(a, d.y * d.y, sign), -d.y)
    return Projection(u, v)


def difference_of_products(a: Any, b: Any, c: Any, d: Any) -> Any:
    """a b - c d with the right sign always and an error below 1.5 ulp (Jeannerod, Louvet, Muller, 2013)."""
    cd = c * d
    error = dr.fma(-c, d, cd)
    return dr.fma(a, b, -cd) + error


@dataclass
class TriangleTest:
    """What one test finds.

    `t`: distance to the plane, of either sign; `within`: the line passes inside the edges or exactly through
    one; `owned`: the same, but of two triangles that share the edge only one claims it; `touched`: the line
    passes inside, or misses an edge by no more than rounding; `height`: signed distance of the ray's origin
    from the plane; `speed`: rate at which it grows; `slack`: a bound on the rounding error of `height`,
    `relative_slack` (32 eps) times the largest coordinate of the origin and of the corners seen from it.
    """

    t: Any
    within: Any
    owned: Any
    touched: Any
    height: Any
    speed: Any
    slack: Any
    relative_slack: float


def meet_triangle(epsilon: float, triangle: Triangle, ray: Ray, axes: Projection) -> TriangleTest:
    """Where the line of the ray meets the plane of the triangle, and whether inside its edges."""
    a, b, c = triangle.v0 - ray.o, triangle.v1 - ray.o, triangle.v2 - ray.o
    ax, ay = dr.dot(a, axes.u), dr.dot(a, axes.v)
    bx, by = dr.dot(b, axes.u), dr.dot(b, axes.v)
    cx, cy = dr.dot(c, axes.u), dr.dot(c, axes.v)
    e0 = difference_of_products(bx, cy, by, cx)
    e1 = difference_of_products(cx, ay, cy, ax)
    e2 = difference_of_products(ax, by, ay, bx)
    size = select_max(select_max(max_abs(a), max_abs(b)), max_abs(c))
    relative_slack = CONTACT_SLACK * epsilon
    slack = relative_slack * select_max(size, max_abs(ray.o))
    low = select_min(select_min(e0, e1), e2)
    high = select_max(select_max(e0, e1), e2)
    height = -dr.dot(triangle.normal, a)
    speed = dr.dot(triangle.normal, ray.d)
    tolerance = 2 * slack * size
    within = ((low >= 0) | (high <= 0)) & (speed != 0)
    return TriangleTest(
        t=-height / speed,
        within=within,
        owned=within & _owns(e0, bx, by, cx, cy) & _owns(e1, cx, cy, ax, ay) & _owns(e2, ax, ay, bx, by),
        touched=((low >= -tolerance) | (high <= tolerance)) & (speed != 0),
        height=height,
        speed=speed,
        slack=slack,
        relative_slack=relative_slack,
    )


def _owns(edge: Any, from_x: Any, from_y: Any, to_x: Any, to_y: Any) -> Any:
    """Mask: a line exactly through this projected edge counts for this triangle; the neighbor runs along it
    the other way, so of the two just one says so (the fill rule of rasterizers)."""
    upward = (to_y > from_y) | ((to_y == from_y) & (to_x > from_x))
    return (edge != 0) | upward
