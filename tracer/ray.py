"""Rays, hits and segments: the records that travel between the camera, the shapes and the loop.

Conventions: directions are unit length; a hit distance `t` is measured along the ray from its origin. Ids
number the primitives of a scene: one for a plane or a sphere, one a triangle, in the order of the shapes and
of the file.

Why there is no epsilon along the ray. A secondary ray starts on a surface, and rounding puts its origin a
little to one side or the other. Instead of pushing it away, the ray carries what is known without rounding:

* `departure`: the primitive it leaves and the side it travels on (`2 id + inside`, `INVALID` for a free ray).
  A plane or a triangle cannot be hit again; on a sphere one root is known to be zero.
* `sides`: one bit for each of the first 32 planes, set when the origin lies on the positive side. Nothing but
  crossing a plane changes its bit, so a ray can neither lose a plane that it starts next to nor hit it twice.

* `view`: in scenes with meshes, the direction towards where the starting point was seen from. It tells on
  which side of a triangle the point is when rounding cannot (`acceleration/departure.py`).

Plain dataclasses with no defaults: frozen ones cannot be loop state, defaults would be shared.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import reduce
from typing import Any

import drjit as dr

from tracer.backends import INVALID, Backend

SIDE_BITS = 32
"""Planes whose side a ray remembers."""


@dataclass
class Ray:
    """n rays. `o`, `d`: (3, n), `departure`, `sides`: (n,) unsigned, `view`: (3, n), None in a scene without
    meshes."""

    o: Any
    d: Any
    departure: Any
    sides: Any
    view: Any

    @property
    def departing(self) -> Any:
        """Mask: the ray starts on a surface of the scene (a lane that hit nothing leaves nothing)."""
        return (self.departure >> 1) != (INVALID >> 1)

    def leaves(self, primitive: Any) -> Any:
        """Mask: the ray starts on that primitive (the word of a free ray names none)."""
        return (self.departure >> 1) == primitive

    @property
    def inside(self) -> Any:
        """Mask: the ray travels on the negative side of the outward normal of the surface that it leaves."""
        return (self.departure & 1) == 1


@dataclass
class Hit:
    """The nearest hit so far: distance `t` (infinite: none) and the id of the primitive."""

    t: Any
    primitive: Any

    @property
    def valid(self) -> Any:
        """Mask: something was hit."""
        return self.primitive != INVALID


def keep_nearer(hit: Hit, t: Any, valid: Any, primitive: Any) -> Hit:
    """The nearer of two hits; of equal distances the lower primitive."""
    closer = valid & ((t < hit.t) | ((t == hit.t) & (primitive < hit.primitive)))
    return Hit(dr.select(closer, t, hit.t), dr.select(closer, primitive, hit.primitive))


@dataclass
class Segment:
    """The straight way to a light: `ray` from the shaded point, `length` to the light at `light` (3, n).

    `light_sides` and `light_decided`: the light's own bits for the first 32 planes, and which of them count
    (a light that lies on a plane is not hidden by it).
    """

    ray: Ray
    length: Any
    light: Any
    light_sides: Any
    light_decided: Any


def no_hit(backend: Backend, width: int) -> Hit:
    """A hit record that says "nothing yet", in full width as loop state needs it."""
    return Hit(
        t=dr.full(backend.Float, float("inf"), width),
        primitive=dr.full(backend.UInt32, INVALID, width),
    )


def departure_word(primitive: Any, inside: Any) -> Any:
    """Packs the primitive that a ray leaves and the side it travels on."""
    return (primitive << 1) | dr.select(inside, type(primitive)(1), type(primitive)(0))


def normalize(v: Any) -> Any:
    """v / |v| by square root and division, each correctly rounded on every backend (`dr.normalize` may use
    an estimate where fast math is on)."""
    return v * dr.rcp(dr.sqrt(dr.squared_norm(v)))


def mirror_direction(d: Any, n: Any) -> Any:
    """r = d + 2 c n with c = -n.d (document, section 3)."""
    return unit_again(dr.fma(-2 * dr.dot(n, d), n, d))


def unit_again(d: Any) -> Any:
    """Takes the rounding out of the length of a nearly unit vector, by one Newton step for 1/sqrt at 1."""
    return d * dr.fma(-0.5, dr.squared_norm(d), 1.5)


def select_min(a: Any, b: Any) -> Any:
    """The smaller one, b when either is NaN: one instruction, unlike `dr.minimum`, which carries NaN on."""
    return dr.select(a < b, a, b)


def select_max(a: Any, b: Any) -> Any:
    """The larger one, b when either is NaN."""
    return dr.select(a > b, a, b)


def largest(values: Iterable[Any]) -> Any:
    """The largest of some numbers."""
    return reduce(select_max, values)


def smallest(values: Iterable[Any]) -> Any:
    """The smallest of some numbers."""
    return reduce(select_min, values)


def max_abs(v: Any) -> Any:
    """The largest |component| of a 3-vector."""
    return largest(dr.abs(c) for c in v)
