"""Tests of boxes and triangles against bundles (`bundles.py`): certain, or said not to be.

Distances are kept as their reciprocals, which are linear in the direction: u = -(n.d)/h for a plane with
normal n at the height h below the point. No division for each ray.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.acceleration.layout import NodeLists
from tracer.acceleration.triangle import Triangle
from tracer.acceleration.walk import Node, octant_of
from tracer.backends import Backend
from tracer.ray import largest, select_max, select_min, smallest

BEHIND = 1 + 2.0**-10
"""How much farther than a hit a box may be and still matter, as a factor of the distance."""

TINY = 2.0**-20
"""Where directions of a bundle have both signs on an axis, they are taken to reach at least so far to either
side; a wider bundle is a careful one."""


@dataclass
class SeenTriangle:
    """n triangles seen from a point: `sides`: normals (3, n) of the planes through the point and each edge,
    turned inwards, `blur`: how much their products with a direction may be off, infinite where it is not
    known from which side the triangle is seen; `rate`: u = d . rate; `share` of u by which it may be off."""

    sides: tuple[Any, Any, Any]
    blur: Any
    rate: Any
    share: Any

    @staticmethod
    def of(backend: Backend, triangle: Triangle, point: Any, rounding: Any) -> SeenTriangle:
        """`rounding`: bound on all that lines through the point and single rays may be off."""
        a, b, c = triangle.v0 - point, triangle.v1 - point, triangle.v2 - point
        height = -dr.dot(triangle.normal, a)
        sides = (
            dr.cross(b, triangle.v2 - triangle.v1),
            dr.cross(c, triangle.v0 - triangle.v2),
            dr.cross(a, triangle.v1 - triangle.v0),
        )
        inverse = -dr.rcp(height)
        return SeenTriangle(
            sides=tuple(backend.Vector3(*(dr.mulsign(x, inverse) for x in side)) for side in sides),
            blur=dr.select(dr.abs(height) <= rounding, dr.inf, rounding * triangle.edge),
            rate=triangle.normal * inverse,
            share=rounding * dr.abs(inverse),
        )

    def along(self, d: Any) -> Passage:
        """How rays in unit directions (3, n) pass it."""
        inside = smallest(dr.dot(side, d) for side in self.sides)
        u = dr.dot(self.rate, d)
        # Comparisons with NaN are false: what is not known to be missed may be met.
        return Passage(
            inside < -self.blur, inside > self.blur, dr.fma(-self.share, u, u), dr.fma(self.share, u, u)
        )


@dataclass
class Passage:
    """How n rays pass triangles: masks of those that certainly are `missed` and that are met `within` the
    edges; else neither. `low`, `high`: bounds on the reciprocal distance of the plane."""

    missed: Any
    within: Any
    low: Any
    high: Any


@dataclass
class Cones:
    """Bundles prepared for box tests: between which reciprocals of directions theirs lie, on each axis, as
    rates and shifts that take a plane to a distance from the point. `start`: distance before which nothing
    counts; `mixed` (3 masks): directions have both signs on an axis.

    Most bundles are not mixed, and their test is cheaper: the others are told from it (`unknown`), and go
    through a kernel for `both` by themselves.
    """

    octant: Any
    mixed: Any
    rates: tuple[Any, Any]
    first: tuple[Any, Any]
    last: tuple[Any, Any]
    start: Any
    both: bool

    @staticmethod
    def of(
        backend: Backend,
        lists: NodeLists,
        point: Any,
        directions: list[Any],
        start: Any,
        rounding: Any,
        both: bool,
    ) -> Cones:
        """Of rays in unit `directions` (RAYS of (3, n)); the rest as for `SeenTriangle`."""
        vector = backend.Vector3
        low = vector(*(smallest(d[k] for d in directions) for k in range(3)))
        high = vector(*(largest(d[k] for d in directions) for k in range(3)))
        octant, mixed = octant_of(backend, high), ~((low > 0) | (high < 0))
        if both:
            ends = (
                dr.select(mixed, dr.minimum(low, -TINY), low),
                dr.select(mixed, dr.maximum(high, TINY), high),
            )
        else:  # the steepest first
            ends = dr.select(low > 0, high, low), dr.select(low > 0, low, high)
        inverses = tuple(dr.rcp(end) for end in ends)
        widest = vector(*(select_max(dr.abs(a), dr.abs(b)) for a, b in zip(*inverses, strict=True)))
        width = rounding * widest
        step, origin = (1, 0) if lists.grid is None else (lists.grid.step, lists.grid.low)
        shifts = tuple((origin - point) * inverse for inverse in inverses)
        last = tuple(shift + width for shift in shifts)
        if both:  # where the lowest direction enters through the plane that the highest crosses last
            last = dr.select(mixed, shifts[0] - width, last[0]), last[1]
        return Cones(
            octant=octant,
            mixed=mixed,
            rates=tuple(step * inverse for inverse in inverses),
            first=tuple(shift - width for shift in shifts),
            last=last,
            start=start,
            both=both,
        )

    @property
    def unknown(self) -> Any:
        """Mask: nothing is known of a bundle."""
        return type(self.mixed.x)(False) if self.both else self.mixed.x | self.mixed.y | self.mixed.z

    def crossed(self, node: Node, least: Any) -> Any:
        """Mask: some ray may meet the box, at a reciprocal distance above `least`."""
        entry, leave = self._span(node) if self.both else self._span_of_one_sign(node)
        return (entry <= leave) & (entry * least <= BEHIND)

    def _span(self, node: Node) -> tuple[Any, Any]:
        """Between which distances (n,) some ray may be in the box."""
        entry, leave = self.start, type(self.start)(dr.inf)
        for k in range(3):
            near = [dr.fma(node.first[k], r[k], s[k]) for r, s in zip(self.rates, self.first, strict=True)]
            far = [dr.fma(node.last[k], r[k], s[k]) for r, s in zip(self.rates, self.last, strict=True)]
            # Away from a box on either side nobody meets it; nobody leaves the slab for good.
            enters = dr.select(self.mixed[k], select_max(near[1], far[0]), select_min(*near))
            leaves = dr.select(self.mixed[k], dr.inf, select_max(*far))
            entry, leave = select_max(entry, enters), select_min(leave, leaves)
        return entry, leave

    def _span_of_one_sign(self, node: Node) -> tuple[Any, Any]:
        """The same for bundles that are not mixed."""
        entry, leave = self.start, type(self.start)(dr.inf)
        for k in range(3):
            # The steepest enters first, the flattest leaves last. Behind the point it is the other way round,
            # but there both are less than 0.
            entry = select_max(entry, dr.fma(node.first[k], self.rates[0][k], self.first[0][k]))
            leave = select_min(leave, dr.fma(node.last[k], self.rates[1][k], self.last[1][k]))
        return entry, leave
