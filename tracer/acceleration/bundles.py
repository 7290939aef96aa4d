"""Bundles: rays through one point, sixteen neighbors to a lane, where rounding cannot change the answer.

A lane takes sixteen neighboring rays through the hierarchy at once. A box is met when it may be met by any
direction between theirs, so they share the work of reaching it; and because all run through one point, the
planes through that point and the edges of a triangle are computed once for all of them. The point is the eye
(`first_of_bundles.py`) or a light (`shadows_of_bundles.py`).

The answers are those of one ray at a time (`traverse.py`), for a bundle only gives those that are certain:
edge functions, distances and their order must be clear of a bound on all rounding, that of the other test
included. Rays that are not (a few in a hundred: they pass close to an edge) are `DOUBTFUL`, and asked singly.
So are those of bundles that meet too many triangles: where these are much smaller than pixels, neighbors have
little in common.

Distances are kept as their reciprocals, which are linear in the direction: u = -(n.d)/h for a plane with
normal n at the height h below the point. No division for each ray.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.acceleration.layout import NodeLists
from tracer.acceleration.triangle import Triangle
from tracer.acceleration.walk import Node, octant_of
from tracer.backends import INVALID, Backend
from tracer.ray import largest, select_max, select_min, smallest

RAYS = 16
"""Rays of a bundle: 4 x 4 pixels. 8 share less, for meshes of a triangle a pixel or less."""

DOUBTFUL = INVALID - 1
"""In place of an answer: rounding could change it."""

BEHIND = 1 + 2.0**-10
"""How much farther than a hit a box may be and still matter, as a factor of the distance."""


TINY = 2.0**-20
"""Where directions of a bundle have both signs on an axis, they are taken to reach at least so far to either
side; a wider bundle is a careful one."""


def in_order(backend: Backend, answers: list[Any]) -> Any:
    """The answers (n,) to each of the RAYS rays of bundles, one after the other (RAYS n,)."""
    n = dr.width(answers[0])
    result = dr.empty(type(answers[0]), n * RAYS)
    for k, answer in enumerate(answers):
        # In any other mode each starts a kernel of its own, with all of the walk.
        place = dr.arange(backend.UInt32, n) * RAYS + k
        dr.scatter(result, answer, place, mode=dr.ReduceMode.Permute)
    return result


def neighbors(backend: Backend, values: Any, bundle: Any) -> list[Any]:
    """The values (RAYS n,) of the RAYS rays of bundles by number, (n,) each."""
    # Packets have 8 words at most.
    packet = backend.IdN if type(values) is backend.UInt32 else backend.FloatN
    shape, halves = (8, dr.width(bundle)), range(RAYS // 8)
    parts = [dr.gather(packet, values, bundle * len(halves) + half, shape=shape) for half in halves]
    return [part[k] for part in parts for k in range(8)]


def neighboring_points(backend: Backend, points: Any, bundle: Any) -> list[Any]:
    """The same of vectors (3, RAYS n)."""
    components = (neighbors(backend, component, bundle) for component in points)
    return [backend.Vector3(*point) for point in zip(*components, strict=True)]


InBundles = Callable[[Any, bool], tuple[Any, Any]]
"""(numbers (n,) of bundles, kernel for `both` signs: see `Cones`) -> the answers to their rays (RAYS n,),
mask (n,) of the bundles of which nothing is known."""


def answers_to(index: Any, rays: int, in_bundles: InBundles, singly: Callable[[Any], Any]) -> Any:
    """The answers to so many rays by number: in bundles, and where these are `DOUBTFUL` by single rays,
    `singly(numbers)`. `index`: the type of numbers and answers."""
    answers, unknown = in_bundles(dr.arange(index, rays // RAYS), False)
    dr.eval(answers, unknown)
    numbers = _numbers_where(unknown)
    if len(numbers) > 0:
        ray = dr.arange(index, len(numbers) * RAYS)
        place = dr.gather(index, numbers, ray // RAYS) * RAYS + ray % RAYS
        dr.scatter(answers, in_bundles(numbers, True)[0], place)
        dr.eval(answers)
    numbers = _numbers_where(answers == DOUBTFUL)
    if len(numbers) > 0:
        dr.scatter(answers, singly(numbers), numbers)
        dr.eval(answers)
    return answers


def _numbers_where(mask: Any) -> Any:
    """Numbers of the lanes of a mask, evaluated, the last one repeated up to a length that few others differ
    from, since each length is recorded for itself; empty when there are none."""
    numbers: Any = dr.compress(mask)
    n, index = len(numbers), type(numbers)
    if n == 0:
        return numbers
    step = max(RAYS, 1 << max(0, n.bit_length() - 3))
    slot = dr.arange(index, -(-n // step) * step)
    padded = dr.gather(index, numbers, dr.minimum(slot, dr.opaque(index, n - 1)))
    dr.eval(padded)
    return padded


@dataclass
class SeenTriangle:
    """n triangles seen from a point: `sides`: normals (3, n) of the planes through the point and each edge,
    turned inwards, `blur`: how much their products with a direction may be off; `rate`: u = d . rate; `share`
    of u by which it may be off; `edge_on`: it is not known from which side the triangle is seen."""

    sides: tuple[Any, Any, Any]
    blur: Any
    rate: Any
    share: Any
    edge_on: Any

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
            blur=rounding * triangle.edge,
            rate=triangle.normal * inverse,
            share=rounding * dr.abs(inverse),
            edge_on=dr.abs(height) <= rounding,
        )

    def along(self, d: Any) -> Passage:
        """How rays in unit directions (3, n) pass it."""
        inside = smallest(dr.dot(side, d) for side in self.sides)
        u = dr.dot(self.rate, d)
        # Comparisons with NaN are false: what is not known to be missed may be met.
        missed = (inside < -self.blur) & ~self.edge_on
        return Passage(missed, inside > self.blur, dr.fma(-self.share, u, u), dr.fma(self.share, u, u))


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
        mixed = ~((low > 0) | (high < 0))
        if both:
            low, high = (
                dr.select(mixed, wider, x)
                for x, wider in ((low, dr.minimum(low, -TINY)), (high, dr.maximum(high, TINY)))
            )
        inverses = (dr.rcp(low), dr.rcp(high))
        widest = vector(*(select_max(dr.abs(a), dr.abs(b)) for a, b in zip(*inverses, strict=True)))
        width = rounding * widest
        step, origin = (1, 0) if lists.grid is None else (lists.grid.step, lists.grid.low)
        shifts = tuple((origin - point) * inverse for inverse in inverses)
        last = tuple(shift + width for shift in shifts)
        if both:  # where the lowest direction enters through the plane that the highest crosses last
            last = dr.select(mixed, shifts[0] - width, last[0]), last[1]
        return Cones(
            octant=octant_of(backend, high),
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
        entry, leave = self.start, type(self.start)(dr.inf)
        for k in range(3):
            near = [dr.fma(node.first[k], r[k], s[k]) for r, s in zip(self.rates, self.first, strict=True)]
            far = [dr.fma(node.last[k], r[k], s[k]) for r, s in zip(self.rates, self.last, strict=True)]
            enters, leaves = select_min(*near), select_max(*far)
            if self.both:
                # Away from a box on either side nobody meets it; nobody leaves the slab for good.
                enters = dr.select(self.mixed[k], select_max(near[1], far[0]), enters)
                leaves = dr.select(self.mixed[k], dr.inf, leaves)
            entry, leave = select_max(entry, enters), select_min(leave, leaves)
        return (entry <= leave) & (entry * least <= BEHIND)
