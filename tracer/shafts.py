"""Which shapes can hide any part of a light from a point: a test for all samples of the light at once.

The straight ways from a point p to the points of a ball (center c, radius R) fill a cone with half angle
alpha, sin alpha = R / |c - p|. A second ball (center b, radius r) covers half an angle beta, sin beta = r /
|b - p|. It meets the cone only if the angle between d = c - p and q = b - p is at most alpha + beta, that
is, if

    d.q + R r >= sqrt(d^2 - R^2) sqrt(q^2 - r^2).

A shape that fails the test hides no sample, and no shadow ray needs to be held against it. This changes no
picture: the test is wide by more than what the rounding of a shadow ray's own test can amount to. (A light's
samples seen as one beam: Amanatides, Ray Tracing with Cones, 1984; the balls: Haines and Greenberg, The Light
Buffer, 1986.)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from tracer.backends import Backend
from tracer.ray import max_abs

POWER_SLACK = 16
"""Bound on the relative error of d^2 and q^2, in units of eps, with what a shadow ray's test may add."""

CONTACT_REACH = 64
"""How far outside its ball a mesh may still be met, in units of eps S: `CONTACT_SLACK` and rounding."""


@dataclass
class Ball:
    """A ball in a kernel: `center` (3, n), `radius` (n,)."""

    center: Any
    radius: Any

    @staticmethod
    def of(backend: Backend, row: np.ndarray) -> Ball:
        """The ball with that row (center, radius) for a kernel."""
        return Ball(backend.opaque_vector(row[:3]), backend.opaque(row[3]))


def ball_around(points: np.ndarray, epsilon: float) -> np.ndarray:
    """(4,) center and radius of a ball that holds the points (n, 3), wide enough for every rounding of
    them."""
    coordinates = np.ascontiguousarray(points.T)  # many times as quick as points one after the other
    low, high = coordinates.min(axis=1), coordinates.max(axis=1)
    center = low + (high - low) / 2
    x, y, z = coordinates - center[:, None]
    extent = max(np.abs(low).max(), np.abs(high).max())
    radius = np.sqrt((x * x + y * y + z * z).max()) + CONTACT_REACH * epsilon * extent
    return np.array([*center, radius])


@dataclass
class Enclosure:
    """The `ball` around a mesh; `shape`: its number; `convex`: no point of it hides a light from another
    point of its outside."""

    ball: Ball
    shape: Any
    convex: bool


@dataclass
class Shaft:
    """The ways from n points to the balls around their lights.

    `apex`, `axis`: p and c - p (3, n); `size`: d^2; `radius`: R; `flank`: sqrt(d^2 - R^2), NaN for a point
    inside the ball; `slack`: bound on rounding, of the order of squares.
    """

    backend: Backend
    apex: Any
    axis: Any
    size: Any
    radius: Any
    flank: Any
    slack: Any

    @staticmethod
    def of(backend: Backend, p: Any, ball: Ball) -> Shaft:
        """The shafts from points (3, n) to a ball."""
        axis = ball.center - p
        reach = max_abs(p)
        size = dr.squared_norm(axis)
        slack = backend.epsilon * (CONTACT_REACH * dr.fma(reach, reach, size))
        flank = dr.sqrt(_power(backend, size, ball.radius))
        return Shaft(backend, p, axis, size, ball.radius, flank, slack)

    def toward(self, center: Any, radius: Any) -> Encounter:
        """How the ways stand to another ball."""
        epsilon = self.backend.epsilon
        q = center - self.apex
        size = dr.squared_norm(q)
        along = dr.dot(self.axis, q)
        tangent = dr.sqrt(_power(self.backend, size, radius))
        slack = dr.fma(epsilon * POWER_SLACK, size, self.slack)
        product = self.flank * tangent
        # NaN, for a point inside one of the balls, is not smaller: it may meet.
        may_meet = ~(dr.fma(self.radius, radius, along) + slack < product)
        gap = dr.fma(-2, along, self.size + size) - dr.square(self.radius + radius)
        # Wide enough for the margin of a light on the sphere (`contact_margin`), too, which grows with r^2.
        apart = gap > 4 * dr.fma(epsilon * CONTACT_REACH, size, self.slack)
        # The square roots come from below; what they lack is the root of what their squares lack.
        lack = (8 * math.sqrt(epsilon)) * (self.size + size)
        wider = dr.square(radius) * self.size > dr.square(self.radius) * size  # beta > alpha
        inside_cone = wider & (along - self.radius * radius > product + lack + slack)
        beyond = (1 + 16 * math.sqrt(epsilon)) * (tangent + self.radius + radius) - radius < self.flank
        return Encounter(may_meet, inside_cone & beyond & apart, apart)


@dataclass
class Encounter:
    """What a shaft's ball is to another one. `may_meet`: certain where False; `covered`: certain where True,
    every way runs through the other ball, from one side to the other; `apart`: the two balls do not
    overlap."""

    may_meet: Any
    covered: Any
    apart: Any


def _power(backend: Backend, size: Any, radius: Any) -> Any:
    """The square of the tangent's length, size - radius^2, from below."""
    relative = POWER_SLACK * backend.epsilon
    return dr.fma(-(1 + relative) * radius, radius, (1 - relative) * size)


@dataclass
class Suspects:
    """Who may hide a light from n points: `spheres` (n,) one bit for each sphere that stands in the kernel,
    in their order, None where they were not looked at; masks `many` and `meshes` (n,): one of many spheres in
    a table, a mesh; `umbra` (n,) mask: something opaque certainly hides all samples of the light."""

    spheres: Any
    many: Any
    meshes: Any
    umbra: Any

    @staticmethod
    def nobody(backend: Backend, width: int, spheres: bool) -> Suspects:
        """No suspects, in full width; `spheres`: whether these are looked at."""
        # Each with memory of its own: `|=` changes arrays in place.
        many, meshes, umbra = (dr.zeros(backend.Bool, width) for _ in range(3))
        return Suspects(dr.zeros(backend.UInt32, width) if spheres else None, many, meshes, umbra)

    @staticmethod
    def everybody(backend: Backend, width: int) -> Suspects:
        """Every sphere and mesh is to be asked."""
        many, meshes = (dr.full(backend.Bool, True, width) for _ in range(2))
        everyone = dr.full(backend.UInt32, 0xFFFFFFFF, width)
        return Suspects(everyone, many, meshes, dr.zeros(backend.Bool, width))

    @property
    def doubtful(self) -> Any:
        """Mask: samples must be asked one by one."""
        listed = self.many | self.meshes
        return (listed if self.spheres is None else listed | (self.spheres != 0)) & ~self.umbra
