"""The triangle that each ray from one eye meets first, in bundles (`bundles.py`): the nearest hit is the one
with the largest reciprocal distance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.acceleration.bundle_tests import Cones, SeenTriangle
from tracer.acceleration.bundles import RAYS, Found
from tracer.acceleration.candidates import Candidates
from tracer.acceleration.triangle import TriangleTables, gather_triangle
from tracer.acceleration.walk import walk
from tracer.backends import INVALID, Backend
from tracer.bits import masks_in_word
from tracer.ray import largest, max_abs, select_max, smallest

STRIDE = 4
"""Steps through the list of nodes between two tests, which are long."""

MOST_TRIANGLES = 96
"""Bundles that meet more are given up."""

ROUNDING = 64
"""How far off a ray may be, in eps of the largest coordinate in play. Seen from the eye: the ray's own origin
and direction round (30), and what is computed with them here (17); projected corners of the other test round,
too (20). Few of these errors are ever as large as they may be, and they do not add up all at once."""

MOST_SHARE = 2.0**-7
"""A triangle whose distance may be off by a larger share is never met for certain: it is seen edge-on."""

HOPE, HELD = 1 - 2.0**-5, 1 + 2.0**-7
"""Where a ray may meet a triangle, what lies much farther (by this factor of the reciprocal distance) is left
out for that ray: of two neighbors that share an edge, one will be met. The bundle has told enough where that
hope held: something is met no farther than this, a factor of the distance, rounding included."""


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


@dataclass
class _Nearest:
    """What n rays have met so far: the `slot` of the nearest certain hit, and `near`, the least
    reciprocal distance that it may have, 0 for nothing; or, where that is larger, a hope (see `HOPE`)."""

    near: Any
    slot: Any


def nearest_of_bundles(backend: Backend, tables: TriangleTables, bundles: Bundles, both: bool) -> Found:
    """For each of the RAYS rays of bundles the slot of the triangle that it meets first, `INVALID` for none;
    `both`: by the kernel for both signs (see `Cones`)."""
    rounding = backend.Float(ROUNDING * backend.epsilon * (max_abs(bundles.eye) + tables.lists.extent))
    begins = smallest(bundles.starts), largest(bundles.starts)
    cones = Cones.of(backend, tables.lists, bundles.eye, bundles.directions, begins[0], rounding, both)
    latest = tuple(dr.rcp(start) for start in begins)
    n = dr.width(cones.octant)
    bundle, candidates = dr.arange(backend.UInt32, n), Candidates.room(backend, n)

    def test(slot: Any, state: Any) -> Any:
        tested, _, spread, close, noted, rays = state
        triangle = gather_triangle(backend, tables.rows, slot)
        seen = SeenTriangle.of(backend, triangle, bundles.eye, rounding)
        clear = seen.share <= MOST_SHARE
        spread = dr.select(clear, select_max(spread, dr.fma(3, seen.share, 1)), spread)
        unclear, found = [], []
        for ray, d in zip(rays, bundles.directions, strict=True):
            passage = seen.along(d)
            began = passage.high < latest[1]
            certain = clear & began & passage.within & (passage.low > ray.near * spread)
            possible = ~passage.missed & ~(passage.high < ray.near) & ~(passage.low > latest[0])
            unclear.append(possible & ~certain)
            hope = clear & began & unclear[-1]
            near = dr.select(hope, select_max(passage.low * HOPE, ray.near), ray.near)
            found.append(_Nearest(dr.select(certain, passage.low, near), dr.select(certain, slot, ray.slot)))
        concerned = masks_in_word(backend, unclear)
        noted = candidates.note(bundle, noted, slot, concerned)
        return tested + 1, smallest(ray.near for ray in found), spread, close | concerned, noted, found

    unknown = cones.unknown
    zero, none = dr.zeros(backend.Float, n), dr.zeros(backend.UInt32, n)
    nothing = _Nearest(zero, dr.full(backend.UInt32, INVALID, n))
    tested, _, _, close, noted, rays = walk(
        backend,
        tables.lists,
        cones.octant,
        crosses=lambda node, state: ~unknown & cones.crossed(node, state[1]),
        test=test,
        state=(none, zero, zero + 1, none, none, [nothing for _ in range(RAYS)]),
        done=lambda state: state[0] > MOST_TRIANGLES,
        stride=STRIDE,
    )
    lost = dr.select(unknown | (tested > MOST_TRIANGLES), backend.UInt32((1 << RAYS) - 1), 0)
    return Found.of(backend, [ray.slot for ray in rays], lost, close, noted, candidates, unknown)
