"""Rays from one eye in bundles: the triangle that each meets first, where rounding cannot change the answer.

A lane takes sixteen neighboring rays through the hierarchy at once. A box is met when it may be met by any
direction between theirs, so they share the work of reaching it; and because all start in one point, the
planes through the eye and the edges of a triangle are computed once for all of them.

The answers are those of one ray at a time (`traverse.py`), for a bundle only gives those that are certain:
edge functions, distances and their order must be clear of a bound on all rounding, that of the other test
included. Rays that are not (one or two in a hundred: they pass close to an edge) are `DOUBTFUL`, and asked
singly. So are those of bundles that meet too many triangles: where these are much smaller than pixels,
neighbors have little in common.

The nearest hit is that with the largest reciprocal distance, which is linear in the direction: u = -(n.d)/h
for a plane with normal n at the height h below the eye. No division for each ray.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.acceleration.layout import NodeLists
from tracer.acceleration.triangle import Triangle, TriangleTables, fetch_triangle
from tracer.acceleration.walk import Node, octant_of, walk
from tracer.backends import INVALID, Backend
from tracer.ray import largest, max_abs, select_max, select_min, smallest

RAYS = 16
"""Rays of a bundle: 4 x 4 pixels. 8 share less, for meshes of a triangle a pixel or less."""

STRIDE = 3
"""Steps through the list of nodes between two tests, which are long."""

MOST_TRIANGLES = 64
"""Bundles that meet more are given up."""

DOUBTFUL = INVALID - 1
"""In place of a primitive: rounding could change the answer."""

ROUNDING = 64
"""How far off a ray may be, in eps of the largest coordinate in play. Seen from the eye: the ray's own origin
and direction round (30), and what is computed with them here (17); projected corners of the other test round,
too (20). Few of these errors are ever as large as they may be, and they do not add up all at once."""


BEHIND = 1 + 2.0**-10
"""How much farther than a hit a box may be and still matter, as a factor of the distance."""


@dataclass
class Bundles:
    """n bundles: the `eye` (3, 1) that all rays come from, `directions` (RAYS unit vectors, (3, n) each) and
    `starts` (RAYS distances from the eye (n,) where each begins)."""

    eye: Any
    directions: list[Any]
    starts: list[Any]

    @staticmethod
    def of(eye: Any, rays: list[tuple[Any, Any]]) -> Bundles:
        """From the origins and unit directions (3, n) of RAYS rays, on lines through the eye."""
        return Bundles(eye, [d for _, d in rays], [dr.sqrt(dr.squared_norm(o - eye)) for o, _ in rays])


def nearest_of_neighbors(
    backend: Backend, tables: TriangleTables, count: int, bundles_of: Callable[[Any], Bundles]
) -> Any:
    """For each of `count` rays the primitive (count,) that it meets first, `INVALID` for none, `DOUBTFUL`
    where that is not certain.

    `bundles_of(numbers)`: bundles by number; RAYS rays with consecutive numbers are one.
    """
    bundle = dr.arange(backend.UInt32, count // RAYS)
    result = dr.empty(backend.UInt32, count)
    for k, found in enumerate(nearest_of_bundles(backend, tables, bundles_of(bundle))):
        # In any other mode each starts a kernel of its own, with all of the walk.
        dr.scatter(result, found, bundle * RAYS + k, mode=dr.ReduceMode.Permute)
    return result


def settle_doubtful(primitive: Any, singly: Callable[[Any], Any]) -> None:
    """Replaces what is `DOUBTFUL` among the primitives (n,) of rays; `singly(numbers)`: the primitives of
    single rays by number."""
    numbers = _doubtful(primitive)
    if len(numbers) > 0:
        dr.eval(numbers)
        dr.scatter(primitive, singly(numbers), numbers)
        dr.eval(primitive)


def _doubtful(primitive: Any) -> Any:
    """Numbers of the doubtful rays, the last one repeated up to a length that few others differ from, since
    each length is recorded for itself; empty when there are none."""
    index = type(primitive)
    numbers: Any = dr.compress(primitive == DOUBTFUL)
    n = len(numbers)
    if n == 0:
        return numbers
    step = max(RAYS, 1 << max(0, n.bit_length() - 3))
    slot = dr.arange(index, -(-n // step) * step)
    return dr.gather(index, numbers, dr.minimum(slot, dr.opaque(index, n - 1)))


def nearest_of_bundles(backend: Backend, tables: TriangleTables, bundles: Bundles) -> list[Any]:
    """For each of the RAYS rays of bundles the primitive (n,) that it meets first: `INVALID` for none,
    `DOUBTFUL` where that is not certain."""
    cones = _Cones.of(backend, tables.lists, bundles)
    rounding = backend.Float(ROUNDING * backend.epsilon * (max_abs(bundles.eye) + tables.lists.extent))
    latest = [dr.rcp(start) for start in bundles.starts]

    def test(slot: Any, state: Any) -> Any:
        triangle, primitive = fetch_triangle(backend, tables.rows, slot)
        seen = _Seen.of(backend, triangle, bundles.eye, rounding)
        rays = [
            seen.by(ray, d, last, primitive)
            for ray, d, last in zip(state[2], bundles.directions, latest, strict=True)
        ]
        return state[0] + 1, _farthest(rays), rays

    none = dr.zeros(backend.Float, dr.width(cones.mixed))
    nothing = _Nearest(none, none, dr.select(cones.mixed, backend.UInt32(DOUBTFUL), INVALID))
    tested, _, rays = walk(
        backend,
        tables.lists,
        cones.octant,
        crosses=lambda node, state: ~cones.mixed & cones.crossed(node, state[1]),
        test=test,
        state=(backend.UInt32(none), none, [nothing for _ in range(RAYS)]),
        done=lambda state: state[0] > MOST_TRIANGLES,
        stride=STRIDE,
    )
    return [dr.select(tested > MOST_TRIANGLES, DOUBTFUL, ray.primitive) for ray in rays]


@dataclass
class _Nearest:
    """What n rays have met first so far: its `primitive`, and bounds on the reciprocal distance; 0 for
    nothing, infinite for a doubtful ray, which nothing makes clear again."""

    low: Any
    high: Any
    primitive: Any


def _farthest(rays: list[_Nearest]) -> Any:
    """The least reciprocal distance up to which anything still counts, for some ray."""
    return smallest(ray.low for ray in rays)


@dataclass
class _Seen:
    """n triangles seen from an eye: `sides`: normals (3, n) of the planes through the eye and each edge,
    turned inwards, `blur`: how much their products with a direction may be off; `rate`: u = d . rate; `share`
    of u by which it may be off; `edge_on`: it is not known from which side the triangle is seen."""

    sides: tuple[Any, Any, Any]
    blur: Any
    rate: Any
    share: Any
    edge_on: Any

    @staticmethod
    def of(backend: Backend, triangle: Triangle, eye: Any, rounding: Any) -> _Seen:
        a, b, c = triangle.v0 - eye, triangle.v1 - eye, triangle.v2 - eye
        height = -dr.dot(triangle.normal, a)
        sides = (
            dr.cross(b, triangle.v2 - triangle.v1),
            dr.cross(c, triangle.v0 - triangle.v2),
            dr.cross(a, triangle.v1 - triangle.v0),
        )
        inverse = -dr.rcp(height)
        return _Seen(
            sides=tuple(backend.Vector3(*(dr.mulsign(x, inverse) for x in side)) for side in sides),
            blur=rounding * triangle.edge,
            rate=triangle.normal * inverse,
            share=rounding * dr.abs(inverse),
            edge_on=dr.abs(height) <= rounding,
        )

    def by(self, ray: _Nearest, d: Any, latest: Any, primitive: Any) -> _Nearest:
        """What a ray has met first, this triangle included. `latest`: reciprocal distance of its start."""
        inside = smallest(dr.dot(side, d) for side in self.sides)
        u = dr.dot(self.rate, d)
        low, high = dr.fma(-self.share, u, u), dr.fma(self.share, u, u)
        # Comparisons with NaN are false: what is not known to be missed is possible.
        missed = (inside < -self.blur) & ~self.edge_on
        possible = ~missed & ~(high < ray.low) & ~(low > latest)
        certain = (inside > self.blur) & (low > ray.high) & (high < latest)
        infinite = type(u)(dr.inf)
        return _Nearest(
            low=dr.select(possible, dr.select(certain, low, infinite), ray.low),
            high=dr.select(possible, dr.select(certain, high, infinite), ray.high),
            primitive=dr.select(possible, dr.select(certain, primitive, DOUBTFUL), ray.primitive),
        )


@dataclass
class _Cones:
    """Bundles prepared for box tests: between which reciprocals of directions theirs lie, on each axis, as
    rates and shifts that take a plane to a distance from the eye. `mixed`: on some axis their directions have
    both signs; nothing is known of such bundles."""

    octant: Any
    mixed: Any
    rates: tuple[Any, Any]
    first: tuple[Any, Any]
    last: tuple[Any, Any]
    start: Any

    @staticmethod
    def of(backend: Backend, lists: NodeLists, bundles: Bundles) -> _Cones:
        vector = backend.Vector3
        low = vector(*(smallest(d[k] for d in bundles.directions) for k in range(3)))
        high = vector(*(largest(d[k] for d in bundles.directions) for k in range(3)))
        mixed = backend.Bool(False)
        for k in range(3):
            mixed = mixed | ~((low[k] > 0) | (high[k] < 0))
        inverses = (dr.rcp(low), dr.rcp(high))
        widest = vector(*(select_max(dr.abs(a), dr.abs(b)) for a, b in zip(*inverses, strict=True)))
        width = ROUNDING * backend.epsilon * (max_abs(bundles.eye) + lists.extent) * widest
        step, origin = (1, 0) if lists.grid is None else (lists.grid.step, lists.grid.low)
        shifts = tuple((origin - bundles.eye) * inverse for inverse in inverses)
        return _Cones(
            octant=octant_of(backend, high),
            mixed=mixed,
            rates=tuple(step * inverse for inverse in inverses),
            first=tuple(shift - width for shift in shifts),
            last=tuple(shift + width for shift in shifts),
            start=smallest(bundles.starts),
        )

    def crossed(self, node: Node, least: Any) -> Any:
        """Mask: some ray may meet the box, at a reciprocal distance above `least`."""
        entry, leave = self.start, type(self.start)(dr.inf)
        for k in range(3):
            near = [dr.fma(node.first[k], r[k], s[k]) for r, s in zip(self.rates, self.first, strict=True)]
            far = [dr.fma(node.last[k], r[k], s[k]) for r, s in zip(self.rates, self.last, strict=True)]
            entry = select_max(entry, select_min(*near))
            leave = select_min(leave, select_max(*far))
        return (entry <= leave) & (entry * least <= BEHIND)
