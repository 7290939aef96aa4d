"""Ray against triangle: watertight, and safe for rays that start on a neighboring triangle.

Inside test: the corners, relative to the origin, are projected along the ray onto two axes; the three edge
functions of the projected triangle decide (Woop, Benthin, Wald, Watertight Ray/Triangle Intersection, JCGT
2013). Two triangles that share a corner project it to the same two numbers, and the sign of an edge function
a b - c d is computed without error (Kahan's difference of products), so a ray that is aimed at a shared edge
or corner cannot pass between them. The distance comes from the plane of the triangle, whose unit normal was
made in double precision.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import drjit as dr
import numpy as np

from tracer.acceleration.layout import NodeLists
from tracer.backends import Backend
from tracer.ray import Ray, largest, max_abs, select_max, smallest
from tracer.replay import NOT_IN_KERNELS

TRIANGLE_WORDS = 16
"""Floats of a triangle in its table: three corners, unit normal (zero: degenerate, never hit), two halves of
its primitive id (whole numbers below 2^16, exact in single precision), the longest edge, 1 unused."""

CONTACT_SLACK = 32
"""Bound on the error of a hit point, in units of eps S: 8 across its surface, and up to 4 times that along it
when the ray arrived at a slant (cosine above 1/4). A generous bound costs nothing, since what it admits is
decided by geometry."""


@dataclass
class TriangleTables:
    """All triangles of a scene in Dr.Jit memory: `rows` of `TRIANGLE_WORDS` words each, in the order of the
    leaves, and the hierarchy over them. On the host: the `box` (2, 3) around all, and the median length of
    their longest edges, `typical_edge`."""

    rows: Any
    lists: NodeLists
    box: np.ndarray = field(metadata=NOT_IN_KERNELS)
    typical_edge: float = field(metadata=NOT_IN_KERNELS)


@dataclass
class Triangle:
    """n triangles: corners and unit geometric normal, each (3, n); length of the longest `edge` (n,)."""

    v0: Any
    v1: Any
    v2: Any
    normal: Any
    edge: Any


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
        vector(a[0], a[1], a[2]),
        vector(a[3], a[4], a[5]),
        vector(a[6], a[7], b[0]),
        vector(b[1], b[2], b[3]),
        b[6],
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
    one; `height`: signed distance of the ray's origin from the plane; `speed`: rate at which it grows. The
    rest is seldom asked for, and computed when it is: `corners` of the triangle seen from the origin,
    `projected` across the ray, and `edges`, their edge functions.
    """

    t: Any
    within: Any
    height: Any
    speed: Any
    origin: Any
    corners: tuple[Any, Any, Any]
    projected: tuple[tuple[Any, Any], ...]
    edges: tuple[Any, Any, Any]
    epsilon: float

    @property
    def owned(self) -> Any:
        """Mask: `within`, but of two triangles that share the edge only one claims it."""
        (a, b, c), (e0, e1, e2) = self.projected, self.edges
        return self.within & _owns(e0, *b, *c) & _owns(e1, *c, *a) & _owns(e2, *a, *b)

    @property
    def size(self) -> Any:
        """The largest coordinate of the corners seen from the origin."""
        return largest(max_abs(corner) for corner in self.corners)

    @property
    def slack(self) -> Any:
        """A bound on the rounding error of `height`: `relative_slack` times the largest coordinate of the
        origin and of the corners seen from it."""
        return self.relative_slack * select_max(self.size, max_abs(self.origin))

    @property
    def relative_slack(self) -> float:
        """32 eps."""
        return CONTACT_SLACK * self.epsilon

    @property
    def touched(self) -> Any:
        """Mask: the line passes inside, or misses an edge by no more than rounding."""
        tolerance = 2 * self.slack * self.size
        low, high = _extremes(*self.edges)
        return ((low >= -tolerance) | (high <= tolerance)) & (self.speed != 0)


def largest_slack(epsilon: float, origin: Any, extent: Any) -> Any:
    """No triangle with coordinates up to `extent` has more `slack` for rays from an origin (3, n)."""
    return (CONTACT_SLACK + 1) * epsilon * (max_abs(origin) + extent)


def meet_triangle(epsilon: float, triangle: Triangle, ray: Ray, axes: Projection) -> TriangleTest:
    """Where the line of the ray meets the plane of the triangle, and whether inside its edges."""
    corners = (triangle.v0 - ray.o, triangle.v1 - ray.o, triangle.v2 - ray.o)
    a, b, c = projected = tuple((dr.dot(v, axes.u), dr.dot(v, axes.v)) for v in corners)
    edges = (_edge(b, c), _edge(c, a), _edge(a, b))
    low, high = _extremes(*edges)
    height = -dr.dot(triangle.normal, corners[0])
    speed = dr.dot(triangle.normal, ray.d)
    within = ((low >= 0) | (high <= 0)) & (speed != 0)
    return TriangleTest(-height / speed, within, height, speed, ray.o, corners, projected, edges, epsilon)


def _edge(start: tuple[Any, Any], end: tuple[Any, Any]) -> Any:
    """The edge function of two projected corners."""
    return difference_of_products(start[0], end[1], start[1], end[0])


def _extremes(a: Any, b: Any, c: Any) -> tuple[Any, Any]:
    """The smallest and the largest of three."""
    return smallest((a, b, c)), largest((a, b, c))


def _owns(edge: Any, from_x: Any, from_y: Any, to_x: Any, to_y: Any) -> Any:
    """Mask: a line exactly through this projected edge counts for this triangle; the neighbor runs along it
    the other way, so of the two just one says so (the fill rule of rasterizers)."""
    upward = (to_y > from_y) | ((to_y == from_y) & (to_x > from_x))
    return (edge != 0) | upward
