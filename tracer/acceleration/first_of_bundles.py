"""The triangle that each ray from one eye meets first, in bundles (`bundles.py`): the nearest hit is the one
with the largest reciprocal distance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.acceleration.bundles import DOUBTFUL, RAYS, Cones, SeenTriangle
from tracer.acceleration.triangle import TriangleTables, fetch_triangle
from tracer.acceleration.walk import walk
from tracer.backends import INVALID, Backend
from tracer.ray import max_abs, smallest

STRIDE = 3
"""Steps through the list of nodes between two tests, which are long."""

MOST_TRIANGLES = 64
"""Bundles that meet more are given up."""

ROUNDING = 64
"""How far off a ray may be, in eps of the largest coordinate in play. Seen from the eye: the ray's own origin
and direction round (30), and what is computed with them here (17); projected corners of the other test round,
too (20). Few of these errors are ever as large as they may be, and they do not add up all at once."""


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


def nearest_of_bundles(
    backend: Backend, tables: TriangleTables, bundles: Bundles, both: bool
) -> tuple[list[Any], Any]:
    """For each of the RAYS rays of bundles the primitive (n,) that it meets first: `INVALID` for none,
    `DOUBTFUL` where that is not certain. Then mask (n,) of the bundles of which nothing is known, unless for
    `both` signs (see `Cones`)."""
    rounding = backend.Float(ROUNDING * backend.epsilon * (max_abs(bundles.eye) + tables.lists.extent))
    cones = Cones.of(
        backend, tables.lists, bundles.eye, bundles.directions, smallest(bundles.starts), rounding, both
    )
    latest = [dr.rcp(start) for start in bundles.starts]

    def test(slot: Any, state: Any) -> Any:
        triangle, primitive = fetch_triangle(backend, tables.rows, slot)
        seen = SeenTriangle.of(backend, triangle, bundles.eye, rounding)
        rays = [
            ray.nearer(seen, d, last, primitive)
            for ray, d, last in zip(state[2], bundles.directions, latest, strict=True)
        ]
        return state[0] + 1, _farthest(rays), rays

    unknown = cones.unknown
    none = dr.zeros(backend.Float, dr.width(cones.octant))
    nothing = _Nearest(none, none, dr.select(unknown, backend.UInt32(DOUBTFUL), INVALID))
    tested, _, rays = walk(
        backend,
        tables.lists,
        cones.octant,
        crosses=lambda node, state: ~unknown & cones.crossed(node, state[1]),
        test=test,
        state=(backend.UInt32(none), none, [nothing for _ in range(RAYS)]),
        done=lambda state: state[0] > MOST_TRIANGLES,
        stride=STRIDE,
    )
    return [dr.select(tested > MOST_TRIANGLES, DOUBTFUL, ray.primitive) for ray in rays], unknown


@dataclass
class _Nearest:
    """What n rays have met first so far: its `primitive`, and bounds on the reciprocal distance; 0 for
    nothing, infinite for a doubtful ray, which nothing makes clear again."""

    low: Any
    high: Any
    primitive: Any

    def nearer(self, seen: SeenTriangle, d: Any, latest: Any, primitive: Any) -> _Nearest:
        """The same with this triangle. `latest`: reciprocal distance of the start of rays along d."""
        passage = seen.along(d)
        low, high = passage.low, passage.high
        possible = ~passage.missed & ~(high < self.low) & ~(low > latest)
        certain = passage.within & (low > self.high) & (high < latest)
        infinite = type(low)(dr.inf)
        return _Nearest(
            low=dr.select(possible, dr.select(certain, low, infinite), self.low),
            high=dr.select(possible, dr.select(certain, high, infinite), self.high),
            primitive=dr.select(possible, dr.select(certain, primitive, DOUBTFUL), self.primitive),
        )


def _farthest(rays: list[_Nearest]) -> Any:
    """The least reciprocal distance up to which anything still counts, for some ray."""
    return smallest(ray.low for ray in rays)
