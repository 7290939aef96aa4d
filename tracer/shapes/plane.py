"""The infinite plane a·x + b·y + c·z + d = 0 (document, section 5)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import drjit as dr
import numpy as np
from pydantic import Field, model_validator
from typing_extensions import Self

from tracer.backends import Backend
from tracer.messages import Refusal
from tracer.ray import SIDE_BITS, Hit, Ray, Segment, keep_nearer, select_max
from tracer.records import Direction, Positive, Vec3, Vec4
from tracer.shapes.base import ShapeRecord

PARALLEL = 1e-12  # sine of the angle between u and v below which they span no plane


class Plane(ShapeRecord):
    """A plane by its coefficients, or by a point and two directions u, v with normal u × v."""

    kind: Literal["plane"] = Field(default="plane", description="an infinite plane")
    coefficients: Vec4 | None = Field(
        default=None,
        description="[a, b, c, d] of a·x + b·y + c·z + d = 0; (a, b, c) is the outward normal",
    )
    point: Vec3 | None = Field(default=None, description="a point of the plane; with `u` and `v`")
    u: Direction | None = Field(default=None, description="first direction in the plane")
    v: Direction | None = Field(default=None, description="second direction; the normal is u × v")
    scale: Positive = Field(default=1.0, description="factor of all positions, about the origin")

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        spanned = [key for key in ("point", "u", "v") if getattr(self, key) is not None]
        if self.coefficients is not None:
            if spanned:
                raise Refusal(f"and `{spanned[0]}` are both given; allowed: one form", "coefficients")
            if not any(self.coefficients[:3]):
                raise Refusal("begins with a zero normal; allowed: a, b, c not all zero", "coefficients")
        elif len(spanned) < 3:
            raise Refusal("needs `coefficients`, or `point`, `u` and `v`")
        elif self.u is not None and self.v is not None and _are_parallel(self.u, self.v):
            raise Refusal("is parallel to `u`; allowed: two directions that span a plane", "v")
        return self

    @staticmethod
    def slot(backend: Backend, row: np.ndarray, primitive: int, plane_number: int) -> PlaneSlot:
        """The plane with that row (n, d) for a kernel; `plane_number` counts the planes of the scene."""
        return PlaneSlot(
            n=backend.opaque_vector(row[:3]),
            d=backend.opaque(row[3]),
            primitive=backend.opaque_id(primitive),
            bit=plane_number if plane_number < SIDE_BITS else None,
        )

    def placed_coefficients(self) -> np.ndarray:
        """(4,) in world space: unit normal n and d with n.p + d = 0, in double precision.

        From a point and two directions: n = u x v / |u x v|, d = -n.p (document, section 5).
        """
        if self.coefficients is not None:
            length = math.hypot(*self.coefficients[:3])
            normal, d = np.array(self.coefficients[:3]) / length, self.coefficients[3] / length
        else:
            cross = np.cross(_unit(self.u), _unit(self.v))
            normal = cross / np.linalg.norm(cross)
            d = -float(normal @ np.asarray(self.point))
        placement = self.placement
        if placement.is_identity:
            return np.array([*normal, d])
        turned = placement.rotation @ normal
        return np.array([*turned, d * self.scale - turned @ placement.shift])


def _unit(direction: Vec3 | None) -> np.ndarray:
    vector = np.asarray(direction, np.float64)
    vector = vector / np.abs(vector).max()
    return vector / np.linalg.norm(vector)


def _are_parallel(u: Vec3, v: Vec3) -> bool:
    """Whether u × v is zero within rounding, whatever the lengths of u and v."""
    largest_u, largest_v = max(map(abs, u)), max(map(abs, v))
    a, b = [c / largest_u for c in u], [c / largest_v for c in v]
    cross = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    return max(map(abs, cross)) < PARALLEL


@dataclass
class PlaneSlot:
    """One plane in a kernel: width-1 numbers that kernels read from memory.

    Attributes: `n` unit normal, `d` with n.p + d = 0, `primitive` its id, `bit` its place in `Ray.sides` (a
    Python int, part of the structure), or None from the 33rd plane on: then the side is the sign of the
    distance.
    """

    n: Any
    d: Any
    primitive: Any
    bit: int | None

    def hit(self, ray: Ray) -> tuple[Any, Any]:
        """Distance and mask of a hit: -(n.o + d) / n.direction, when the ray heads for the side it is not on.

        Whether it is hit is decided by the side bit alone; rounding of the distance can only move the hit to
        t = 0.
        """
        speed = dr.dot(self.n, ray.d)
        distance = dr.dot(self.n, ray.o) + self.d
        above = self.above(ray.sides, distance)
        valid = dr.select(above, speed < 0, speed > 0)
        if self.bit is None:
            valid = valid & ~ray.leaves(self.primitive)
        t = -distance / speed
        return select_max(t, type(t)(0)), valid

    def closest(self, ray: Ray, hit: Hit, active: Any) -> Hit:
        """The nearer of `hit` and this plane's hit."""
        return keep_nearer(hit, *self.hit(ray), self.primitive)

    def blocks(self, segment: Segment, active: Any) -> Any:
        """Mask: the plane lies strictly between the two ends, which is so when they are on different
        sides."""
        if self.bit is not None:
            differs = (segment.ray.sides ^ segment.light_sides) & segment.light_decided
            return (differs & (1 << self.bit)) != 0
        t, valid = self.hit(segment.ray)
        return valid & (t < segment.length)

    def above(self, sides: Any, distance: Any) -> Any:
        """Mask: the origin is on the positive side."""
        return distance > 0 if self.bit is None else (sides & (1 << self.bit)) != 0

    def crossings(self, segment: Segment, active: Any) -> Any:
        """How many of its surfaces lie between the two ends: 0 or 1."""
        return dr.select(self.blocks(segment, active), type(segment.length)(1), 0)

    @staticmethod
    def surface(row: Any, p: Any) -> tuple[Any, Any]:
        """The point moved onto the plane, and the outward normal, from the plane's row (n, d) of the shape
        table."""
        n = type(p)(row.x, row.y, row.z)
        return p - (dr.dot(n, p) + row.w) * n, n

    def side_bit(self, ray_o: Any, ray_d: Any) -> Any:
        """This plane's bit for a free ray; an origin exactly on the plane counts as having crossed it
        already."""
        distance = dr.dot(self.n, ray_o) + self.d
        above = (distance > 0) | ((distance == 0) & (dr.dot(self.n, ray_d) > 0))
        one = type(self.primitive)(1 << (self.bit or 0))
        return dr.select(above, one, 0)
