"""The sphere (document, section 5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import drjit as dr
import numpy as np
from pydantic import Field

from tracer.backends import Backend
from tracer.branches import changed_where
from tracer.ray import Hit, Ray, Segment, keep_nearer, normalize, select_max
from tracer.records import Positive, Vec3
from tracer.shapes.base import ShapeRecord


class Sphere(ShapeRecord):
    """A sphere by center and radius."""

    kind: Literal["sphere"] = Field(default="sphere", description="a sphere")
    center: Vec3 = Field(description="center, in scene units")
    radius: Positive = Field(description="radius, in scene units")
    scale: Positive = Field(default=1.0, description="factor of center and radius, about the origin")

    @staticmethod
    def slot(backend: Backend, row: np.ndarray, primitive: int, plane_number: int) -> SphereSlot:
        """The sphere with that row (center, radius) for a kernel."""
        return SphereSlot(
            center=backend.opaque_vector(row[:3]),
            radius=backend.opaque(row[3]),
            margin=backend.opaque(contact_margin(row, backend.epsilon)),
            primitive=backend.opaque_id(primitive),
        )

    def placed_coefficients(self) -> np.ndarray:
        """(4,) in world space: center and radius."""
        center = self.placement.points(np.array([self.center]))[0]
        return np.array([*center, self.radius * self.scale])


def contact_margin(row: np.ndarray, epsilon: float) -> float:
    """Bound on the rounding of |o-c|^2 - r^2 for an origin on a surface that touches the sphere.

    A position there is known to 8 eps (|c| + r) across its surface and to 4 times that along it, and the
    square changes 2 r times as fast.
    """
    extent = float(np.abs(row[:3]).max() + row[3])
    return 64 * epsilon * float(row[3]) * extent


@dataclass
class SphereSlot:
    """One sphere in a kernel: width-1 numbers that kernels read from memory.

    Attributes: `center`, `radius`, `primitive` (its id), `margin` (see `contact_margin`).
    """

    center: Any
    radius: Any
    margin: Any
    primitive: Any

    def closest(self, ray: Ray, hit: Hit, active: Any) -> Hit:
        """The nearer of `hit` and this sphere's hit.

        The quadratic is solved around the point of the ray that is closest to the center (Hearn and Baker;
        Haines et al., Precision Improvements for Ray/Sphere Intersection, Ray Tracing Gems, 2019, chapter 7).
        """
        b, discriminant, outside = self._solve(ray)
        own = ray.leaves(self.primitive)
        approaches = ~outside | ((b > 0) & ~own)
        meets = ((discriminant >= 0) | own) & approaches

        def nearer(hit: Hit) -> Hit:
            half_chord = dr.sqrt(discriminant)
            t = dr.select(outside, b - half_chord, b + half_chord)
            t = dr.select(own, 2 * b, t)  # one root is the origin; inside, the other is there however grazing
            valid = meets & (ray.departing | (t > 0))
            return keep_nearer(hit, select_max(t, type(t)(0)), valid, self.primitive)

        return changed_where(meets & active, hit, nearer, label="sphere")

    def may_block(self, segment: Segment, epsilon: float) -> Any:
        """Mask, False only where `blocks` is False: the light sees the other end within the cone around the
        sphere, or nearly so; a third of the operations.

        With v from the center to the light and d the direction to it, the cone ends where d.v is as long as
        the tangent. Rounding moves the line by 15 eps of the way to the center at most, and an end on the
        sphere by less than its `margin` allows. Of lights within two radii nothing is told.
        """
        v, r2, slack = segment.light - self.center, self.radius * self.radius, 64 * epsilon
        distance2 = dr.squared_norm(v)
        rounding = dr.fma(slack, dr.sqrt(distance2), self.margin / self.radius)
        least = dr.select(distance2 < 4 * r2, -dr.inf, dr.sqrt(distance2 - r2) - rounding)
        return dr.fma(slack, segment.length, dr.dot(v, segment.ray.d)) >= least

    def blocks(self, segment: Segment, active: Any) -> Any:
        """Mask: the sphere lies strictly between the two ends; decided without a square root."""
        near, far, outside = self._crossed(segment)
        return dr.select(outside, near, far)

    def crossings(self, segment: Segment, active: Any) -> Any:
        """How many of its surfaces lie strictly between the two ends: 0, 1 or 2; the one left does not
        count."""
        near, far, outside = self._crossed(segment)
        one = type(segment.length)(1)
        return dr.select(outside & near, one, 0) + dr.select(far & (~outside | near), one, 0)

    def _crossed(self, segment: Segment) -> tuple[Any, Any, Any]:
        """Masks: the near surface is crossed on the way (if the ray starts outside), the far one is, and
        the ray starts outside. A light that lies on the sphere within rounding has not crossed the surface
        it lies on."""
        b, discriminant, outside = self._solve(segment.ray)
        light = dr.squared_norm(segment.light - self.center) - self.radius * self.radius
        past_middle = b < segment.length
        meets = (b > 0) & (discriminant > 0) & ~segment.ray.leaves(self.primitive)
        return meets & (past_middle | (light < -self.margin)), past_middle & (light > self.margin), outside

    def _solve(self, ray: Ray) -> tuple[Any, Any, Any]:
        """Distance to the closest approach, half chord squared, and whether the origin is outside.

        A ray that leaves this sphere knows its side. One that leaves another surface within the margin counts
        as outside: a ball that rests on a plane is met from outside, however the contact point was rounded.
        """
        oc = ray.o - self.center
        b = -dr.dot(oc, ray.d)
        perpendicular = dr.fma(b, ray.d, oc)
        r2 = self.radius * self.radius
        discriminant = r2 - dr.squared_norm(perpendicular)
        margin = dr.select(ray.departing, -self.margin, 0)
        outside = dr.select(ray.leaves(self.primitive), ~ray.inside, dr.squared_norm(oc) - r2 > margin)
        return b, discriminant, outside

    @staticmethod
    def surface(row: Any, p: Any) -> tuple[Any, Any]:
        """The point moved onto the sphere, and the outward normal, from the sphere's row (center, radius)."""
        center = type(p)(row.x, row.y, row.z)
        n = normalize(p - center)
        return dr.fma(n, row.w, center), n
