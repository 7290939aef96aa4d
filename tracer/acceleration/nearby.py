"""Rays that start far away are tested near the triangles.

Rounding grows with the largest coordinate in play, and boxes are widened by it. A ray that starts a million
times farther away than any triangle lies, on a floor near the horizon, would see boxes wider than the mesh:
it would test every triangle, and decide by noise. So the start of such a ray is moved along it to where the
triangles begin (exactly on the line but for one rounding there, by a fused multiply-add), and a shadow ray
from such a point starts at its light.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from tracer.acceleration.layout import NodeLists
from tracer.backends import Backend
from tracer.ray import Hit, Ray, Segment, max_abs

FAR = 16
"""Rays start far away when a coordinate is larger than this many times all those of triangles."""

NEAR = 4
"""Their start is moved to about this many times the largest coordinate of the triangles from the coordinate
origin, and all triangles, which are within sqrt(3) times, lie farther on."""

ROUNDING = 8
"""By so many eps of the far start's largest coordinate the way there may be too long: twice sqrt(3) of them
by the product, and as many because directions have unit length within rounding only."""


@dataclass
class Nearby:
    """n rays as the triangles see them: `ray`, which starts `ahead` (n,) of the given one; mask `moved` of
    those with another start, which none of the triangles is near."""

    ray: Ray
    ahead: Any
    moved: Any

    @staticmethod
    def of(backend: Backend, lists: NodeLists, ray: Ray) -> Nearby:
        """The same lines (3, n) from a nearer start."""
        margin = dr.fma(ROUNDING * backend.epsilon, max_abs(ray.o), NEAR * lists.extent)
        ahead = -dr.dot(ray.o, ray.d) - margin
        moved = _is_far(lists, ray.o) & (ahead > 0)
        ahead = dr.select(moved, ahead, 0)
        return Nearby(replace(ray, o=dr.fma(ahead, ray.d, ray.o)), ahead, moved)

    def seen(self, hit: Hit) -> Hit:
        """A hit of the given rays as one of these."""
        return Hit(hit.t - self.ahead, hit.primitive)

    def given(self, hit: Hit, before: Hit) -> Hit:
        """A hit of these as one of the given rays; `before`: of those, what they hit if nothing nearer."""
        found = hit.primitive != before.primitive
        return Hit(dr.select(found, hit.t + self.ahead, before.t), hit.primitive)


def toward_point(lists: NodeLists, segment: Segment) -> tuple[Ray, Any, Any]:
    """The way between a point and its light for triangles that may hide it: a ray, the distance (n,) of the
    light from its start, and mask: it starts at the light."""
    start, turned = segment.ray.o, _is_far(lists, segment.ray.o)
    turned = turned & (max_abs(segment.light) < max_abs(start))
    ray = replace(
        segment.ray,
        o=dr.select(turned, segment.light, start),
        d=dr.select(turned, -segment.ray.d, segment.ray.d),
    )
    return ray, dr.select(turned, 0, segment.length), turned


def _is_far(lists: NodeLists, start: Any) -> Any:
    return max_abs(start) > FAR * lists.extent
