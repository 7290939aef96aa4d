"""Which points a light does not reach, in bundles (`bundles.py`) from the light to sixteen neighbors.

What single shadow rays do at the point itself is left to them (`departure.py`): hits so near to it that
rounding could decide are doubtful. So are triangles in whose plane the light lies.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.acceleration.bundle_tests import Cones, SeenTriangle
from tracer.acceleration.bundles import RAYS, Found
from tracer.acceleration.candidates import Candidates
from tracer.acceleration.triangle import TriangleTables, fetch_triangle, largest_slack
from tracer.acceleration.walk import walk
from tracer.backends import Backend
from tracer.bits import masks_in_word
from tracer.branches import changed_where
from tracer.ray import largest, max_abs, select_max, smallest

LIT, HIDDEN = 0, 1
"""The other answers than `DOUBTFUL`."""

STRIDE = 4
"""Steps through the list of nodes between two tests, which are long."""

MOST_TRIANGLES = 40
"""Bundles that meet more are given up."""

ROUNDING = 96
"""How far off a line from the light to a point may be, in eps of the largest coordinate in play: what
`first_of_bundles.py` allows for rays from the eye, and how near to a plane (32) single rays let geometry
decide."""


@dataclass
class LitPoints:
    """Points of n bundles, lists of RAYS each: the `reach` (n,) from the light up to which what hides it does
    so certainly, 0 where nobody asks; and what is only looked up where somebody does, the `points` (3, n) on
    surfaces and their `primitives` (n,)."""

    reach: list[Any]
    points: Callable[[], list[Any]]
    primitives: Callable[[], list[Any]]


def certain_reach(backend: Backend, tables: TriangleTables, p: Any, normal: Any, light: Any) -> Any:
    """The `reach` (n,) for points (3, n) with a unit normal on the lit side.

    Beyond it, a hit may lie within rounding of the tangent plane, where single shadow rays let geometry
    decide.
    """
    to_light = light - p
    distance = dr.norm(to_light)
    climb = dr.dot(normal, to_light) / distance
    near = 2 * largest_slack(backend.epsilon, p, tables.lists.extent) / select_max(climb, backend.epsilon)
    # Positive, though nothing lies nearer: somebody asks.
    return select_max(distance - near, dr.smallest(backend.Float))


def hidden_points(
    backend: Backend, tables: TriangleTables, light: Any, bundles: LitPoints, both: bool
) -> Found:
    """For each of the RAYS points of bundles: whether triangles leave it `LIT` by a light (3, 1), or it is
    `HIDDEN`; `both`: by the kernel for both signs (see `Cones`)."""
    asked = [reach > 0 for reach in bundles.reach]
    all_asked = masks_in_word(backend, asked)
    none = dr.zeros(backend.UInt32, dr.width(all_asked))
    candidates = Candidates.room(backend, dr.width(all_asked))

    def walked(_: Any) -> Any:
        return _walked(backend, tables, light, bundles, asked, all_asked, both, candidates)

    nothing = none, none, none, none, none != 0
    hidden, lost, close, noted, unknown = changed_where(all_asked != 0, nothing, walked, label="asked")
    answers = [dr.select((hidden >> k) & 1 != 0, backend.UInt32(HIDDEN), LIT) for k in range(RAYS)]
    return Found.of(backend, answers, lost, close, noted, candidates, unknown)


def _walked(
    backend: Backend,
    tables: TriangleTables,
    light: Any,
    bundles: LitPoints,
    asked: list[Any],
    all_asked: Any,
    both: bool,
    candidates: Candidates,
) -> tuple[Any, Any, Any, Any, Any]:
    """Words with a bit for each who asks that certainly is hidden, that gets no answer, and of whom
    `candidates` decide; how many these are; and mask of the bundles of which nothing is known."""
    points = bundles.points()
    primitives = bundles.primitives()
    ways = [p - light for p in points]
    inverse = [dr.rsqrt(dr.squared_norm(way)) for way in ways]
    directions = _of_those_who_ask([way * i for way, i in zip(ways, inverse, strict=True)], asked)
    ends = [dr.select(asks, max_abs(p), 0) for asks, p in zip(asked, points, strict=True)]
    rounding = (ROUNDING * backend.epsilon) * (max_abs(light) + tables.lists.extent + largest(ends))
    cones = Cones.of(backend, tables.lists, light, directions, backend.Float(0), rounding, both)
    unknown = cones.unknown
    farthest = smallest(dr.select(asks, i, dr.inf) for asks, i in zip(asked, inverse, strict=True))
    latest = [dr.rcp(reach) for reach in bundles.reach]
    bundle = dr.arange(backend.UInt32, dr.width(all_asked))

    def test(slot: Any, state: Any) -> Any:
        tested, hidden, possible, noted = state
        triangle, primitive = fetch_triangle(backend, tables.rows, slot)
        seen = SeenTriangle.of(backend, triangle, light, rounding)
        hides, may_hide = [], []
        for k, (d, end) in enumerate(zip(directions, inverse, strict=True)):
            passage = seen.along(d)
            may_hide.append(~passage.missed & ~(passage.high < end) & (primitive != primitives[k]))
            hides.append(may_hide[k] & passage.within & (passage.low > latest[k]))
        hidden = hidden | masks_in_word(backend, hides)
        concerned = masks_in_word(backend, may_hide) & all_asked & ~hidden
        return tested + 1, hidden, possible | concerned, candidates.note(bundle, noted, slot, concerned)

    none = dr.zeros(backend.UInt32, dr.width(all_asked))
    tested, hidden, possible, noted = walk(
        backend,
        tables.lists,
        cones.octant,
        crosses=lambda node, _: ~unknown & cones.crossed(node, farthest),
        test=test,
        state=(none, none, none, none),
        done=lambda state: (state[0] > MOST_TRIANGLES) | ((all_asked & ~state[1]) == 0),
        stride=STRIDE,
    )
    hidden = hidden & all_asked
    lost = dr.select(unknown | (tested > MOST_TRIANGLES), all_asked & ~hidden, 0)
    return hidden, lost, possible & ~hidden, noted, unknown


def _of_those_who_ask(directions: list[Any], asked: list[Any]) -> list[Any]:
    """The directions, those that nobody asks for replaced by one that somebody does."""
    some = directions[0]
    for d, asks in zip(directions, asked, strict=True):
        some = dr.select(asks, d, some)
    return [dr.select(asks, d, some) for d, asks in zip(directions, asked, strict=True)]
