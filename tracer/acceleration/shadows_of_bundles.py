"""Which points a light does not reach, in bundles (`bundles.py`) from the light to sixteen neighbors.

What single shadow rays do at the point itself is left to them (`departure.py`): hits so near to it that
rounding could decide are doubtful. So are triangles in whose plane the light lies.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.acceleration.bundles import DOUBTFUL, RAYS, Cones, SeenTriangle
from tracer.acceleration.triangle import TriangleTables, fetch_triangle, largest_slack
from tracer.acceleration.walk import walk
from tracer.backends import Backend
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
) -> tuple[list[Any], Any]:
    """For each of the RAYS points of bundles (n,): whether triangles leave it `LIT` by a light (3, 1), it is
    `HIDDEN`, or that is `DOUBTFUL`. Then mask (n,) of the bundles of which nothing is known, unless for
    `both` signs (see `Cones`)."""
    asked = [reach > 0 for reach in bundles.reach]
    all_asked = _bits(backend, asked)
    none = dr.zeros(backend.UInt32, dr.width(all_asked))

    def walked(found: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
        return _walked(backend, tables, light, bundles, asked, all_asked, both, found)

    nothing = none, none, dr.full(backend.Bool, False, dr.width(none))
    hidden, possible, unknown = changed_where(all_asked != 0, nothing, walked, label="asked")
    answers = []
    for k in range(RAYS):
        doubtful = dr.select((possible >> k) & 1 != 0, backend.UInt32(DOUBTFUL), LIT)
        answers.append(dr.select((hidden >> k) & 1 != 0, HIDDEN, doubtful))
    return answers, unknown


def _walked(
    backend: Backend,
    tables: TriangleTables,
    light: Any,
    bundles: LitPoints,
    asked: list[Any],
    all_asked: Any,
    both: bool,
    nothing: tuple[Any, Any, Any],
) -> tuple[Any, Any, Any]:
    """Of those who ask, a bit for each that certainly is hidden, and for each that may be; and mask of the
    bundles of which nothing is known."""
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

    def test(slot: Any, state: Any) -> Any:
        tested, hidden, possible = state
        triangle, primitive = fetch_triangle(backend, tables.rows, slot)
        seen = SeenTriangle.of(backend, triangle, light, rounding)
        hides, may_hide = [], []
        for k, (d, end) in enumerate(zip(directions, inverse, strict=True)):
            passage = seen.along(d)
            may_hide.append(~passage.missed & ~(passage.high < end) & (primitive != primitives[k]))
            hides.append(may_hide[k] & passage.within & ~seen.edge_on & (passage.low > latest[k]))
        return tested + 1, hidden | _bits(backend, hides), possible | _bits(backend, may_hide)

    tested, hidden, possible = walk(
        backend,
        tables.lists,
        cones.octant,
        crosses=lambda node, _: ~unknown & cones.crossed(node, farthest),
        test=test,
        state=(dr.zeros(backend.UInt32, dr.width(all_asked)), *nothing[:2]),
        done=lambda state: (state[0] > MOST_TRIANGLES) | ((all_asked & ~state[1]) == 0),
        stride=STRIDE,
    )
    doubtful = unknown | (tested > MOST_TRIANGLES)
    return hidden & all_asked, dr.select(doubtful, all_asked, possible & all_asked), unknown | nothing[2]


def _of_those_who_ask(directions: list[Any], asked: list[Any]) -> list[Any]:
    """The directions, those that nobody asks for replaced by one that somebody does."""
    some = directions[0]
    for d, asks in zip(directions, asked, strict=True):
        some = dr.select(asks, d, some)
    return [dr.select(asks, d, some) for d, asks in zip(directions, asked, strict=True)]


def _bits(backend: Backend, masks: list[Any]) -> Any:
    """Bit k of a word is mask k."""
    word = backend.UInt32(0)
    for k, mask in enumerate(masks):
        word = word | dr.select(mask, backend.UInt32(1 << k), 0)
    return word
