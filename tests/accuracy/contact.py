"""What a secondary ray must meet, reasoned in double precision: convex solids in contact, with a band of
doubt.

A ray comes from open space and hits solid f at p, so p lies outside every other solid, however it was
rounded. A ray that leaves f outwards can never meet f again; one that goes through f is inside of it until
the line leaves f. Another solid g is met where the line enters it in front of p. The line certainly meets g
when it meets g shrunk by the bound on rounding, and certainly misses g when it misses g grown by it. Where
p itself lies within the bound of g, the grown g holds p; then g is missed when the line leaves the grown g
at once. All other cases are doubtful and are left out; tests bound how many they may be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

Array = np.ndarray
STEEP = 4.0
"""A ray in contact with g surely leaves it when n.d > STEEP sqrt(bound / size): it then does not dip into
it."""


class Solid(Protocol):
    """A convex solid: the interval of lines in it, grown by a distance."""

    def interval(self, o: Array, d: Array, grown: float) -> tuple[Array, Array]:
        """Distances (n,), (n,) at which the lines enter and leave; inf, -inf where they miss."""

    def outward(self, p: Array) -> Array:
        """Outward normals (n, 3) at points of the surface."""


@dataclass(frozen=True)
class Ball:
    """A sphere."""

    center: Array
    radius: float

    def interval(self, o: Array, d: Array, grown: float) -> tuple[Array, Array]:
        """See `Solid`."""
        oc = o - self.center
        b = -(oc * d).sum(1)
        across = oc + b[:, None] * d
        square = (self.radius + grown) ** 2 - (across**2).sum(1)
        half = np.sqrt(np.maximum(square, 0))
        return np.where(square > 0, b - half, np.inf), np.where(square > 0, b + half, -np.inf)

    def outward(self, p: Array) -> Array:
        """See `Solid`."""
        return (p - self.center) / self.radius


@dataclass(frozen=True)
class Polytope:
    """The points with normals.x <= offsets: a box, or with one row a half space."""

    normals: Array
    offsets: Array

    def interval(self, o: Array, d: Array, grown: float) -> tuple[Array, Array]:
        """See `Solid`."""
        height = o @ self.normals.T - (self.offsets + grown)
        speed = d @ self.normals.T
        with np.errstate(divide="ignore", invalid="ignore"):
            t = -height / speed
        enter = np.where(speed < 0, t, np.where((speed == 0) & (height > 0), np.inf, -np.inf)).max(1)
        leave = np.where(speed > 0, t, np.where((speed == 0) & (height > 0), -np.inf, np.inf)).min(1)
        misses = enter >= leave
        return np.where(misses, np.inf, enter), np.where(misses, -np.inf, leave)

    def outward(self, p: Array) -> Array:
        """See `Solid`."""
        return self.normals[np.abs(p @ self.normals.T - self.offsets).argmin(1)]

    def faces_close(self, p: Array, distance: float) -> Array:
        """How many face planes pass within `distance` of the points."""
        return (np.abs(p @ self.normals.T - self.offsets) < distance).sum(1)


@dataclass(frozen=True)
class Verdict:
    """What is true of n rays: `solid` (-1: none) and `t` of the first hit; `certain`: free of doubt."""

    solid: Array
    t: Array
    cosine: Array
    certain: Array


def first_contact(
    solids: Sequence[Any], left: Array, crosses: bool, p: Array, d: Array, bound: float, size: float
) -> Verdict:
    """The truth for rays that leave solid `left` (n,) at p in direction d (n, 3)."""
    n = len(p)
    solid, nearest, cosine = np.full(n, -1), np.full(n, np.inf), np.zeros(n)
    certain = np.ones(n, bool)
    for number, g in enumerate(solids):
        own = left == number
        t0, t1 = g.interval(p, d, 0.0)
        s0, s1 = g.interval(p, d, -bound)
        e0, e1 = g.interval(p, d, bound)
        in_contact = (e0 <= 0) & (e1 >= 0)
        meets = s1 > np.maximum(s0, 0)
        departs = (g.outward(p) * d).sum(1) > STEEP * np.sqrt(bound / size)
        misses = ~meets & ((e1 <= 0) | (in_contact & departs))
        t = np.maximum(t0, 0)
        if isinstance(g, Polytope) and len(g.normals) > 1:
            certain &= own | ~in_contact | (g.faces_close(p, 4 * bound) <= 1)
        if crosses:
            meets, misses, t = (
                np.where(own, s1 > 0, meets),
                np.where(own, e1 <= 0, misses),
                np.where(own, t1, t),
            )
        else:
            meets, misses = meets & ~own, misses | own
        certain &= meets | misses
        nearer = meets & (t < nearest)
        with np.errstate(invalid="ignore"):  # inf - inf where neither is met
            tie = meets & (solid >= 0) & (np.abs(t - nearest) < 8 * bound)
        certain &= ~tie
        at = p + np.where(nearer & np.isfinite(t), t, 0)[:, None] * d
        cosine = np.where(nearer, np.abs((g.outward(at) * d).sum(1)), cosine)
        solid, nearest = np.where(nearer, number, solid), np.where(nearer, t, nearest)
    return Verdict(solid, nearest, cosine, certain)
