"""Rays against the boxes of a hierarchy (Kay and Kajiya, Ray Tracing Complex Scenes, 1986)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.acceleration.layout import NodeLists
from tracer.acceleration.triangle import Triangle
from tracer.acceleration.walk import Node, octant_of
from tracer.backends import Backend
from tracer.ray import Ray, largest, max_abs, select_max, select_min, smallest

SMALLEST_COMPONENT = 1e-20
"""Direction components below this count as this: their reciprocal stays finite, the ray moves by 1e-20 of its
way."""

WIDTH = 32
"""Boxes are widened by this many eps of the largest coordinate in play. The test of what lies in them may
accept a line that misses it by the rounding of its coordinates seen from the origin (8), the distances to the
planes of a box round, too (11), and the box of a single triangle must lie inside those around it."""

OWN_WIDTH = 8
"""The same for the box of a single triangle, whose distances round by 4 at most."""


@dataclass
class Slabs:
    """Rays prepared for box tests: the octant of each, and what takes a plane (in units of the lists) to the
    distance where it is crossed first or last, moved by the bound on all rounding."""

    octant: Any
    inverse: Any
    rate: Any
    shift_first: Any
    shift_last: Any
    width: Any

    @staticmethod
    def of(backend: Backend, lists: NodeLists, ray: Ray, widening: float = WIDTH) -> Slabs:
        """For n rays; `widening`: of boxes, in eps of the largest coordinate in play."""
        tiny = backend.Float(SMALLEST_COMPONENT)
        d = backend.Vector3(*(dr.select(dr.abs(c) < tiny, dr.select(c < 0, -tiny, tiny), c) for c in ray.d))
        inverse = dr.rcp(d)
        width = backend.epsilon * (max_abs(ray.o) + lists.extent) * dr.abs(inverse)
        rate, start = inverse, -ray.o
        if lists.grid is not None:
            rate, start = lists.grid.step * inverse, lists.grid.low - ray.o
        shift = start * inverse
        return Slabs(
            octant_of(backend, d), inverse, rate, shift - widening * width, shift + widening * width, width
        )

    def crossed(self, node: Node, limit: Any) -> Any:
        """Mask: the ray meets the widened box of the node in 0 <= t <= limit."""
        near = dr.fma(node.first, self.rate, self.shift_first)
        far = dr.fma(node.last, self.rate, self.shift_last)
        return _entry(near) <= select_min(smallest(far), limit)

    def own_span(self, ray: Ray, triangle: Triangle) -> tuple[Any, Any]:
        """Where the ray enters and leaves the box of a triangle."""
        first, last = [], []
        for k, (a, b, c) in enumerate(zip(triangle.v0, triangle.v1, triangle.v2, strict=True)):
            low, high = smallest((a, b, c)), largest((a, b, c))
            negative = (self.octant & (1 << k)) != 0
            first.append(dr.select(negative, high, low))
            last.append(dr.select(negative, low, high))
        vector, margin = type(triangle.v0), OWN_WIDTH * self.width
        near = (vector(*first) - ray.o) * self.inverse - margin
        far = (vector(*last) - ray.o) * self.inverse + margin
        return _entry(near), smallest(far)


def _entry(near: Any) -> Any:
    """The last entry into a slab, not before 0."""
    return select_max(select_max(near.x, near.y), select_max(near.z, type(near.z)(0)))
