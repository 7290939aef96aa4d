"""A whole light against a hierarchy: one walk that most often spares a shadow ray for each of its samples.

The ways from a point to all samples of a light lie in a cone, its shaft (`tracer/shafts.py`). The walk looks
for triangles that the shaft may touch. A triangle is out of it when the point and the light's ball lie on
one side of its plane, or when the ball lies beyond one of the planes through the point and an edge. When the
ball lies inside all three of these and behind the triangle, the triangle hides the light as a whole. Among
many spheres the same walk asks each what `shafts.py` asks of one.

Every test is wide by more than the rounding and the contact rules of the rays that it stands for
(`triangle.py`, `departure.py`), so no answer differs from theirs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.acceleration.layout import NodeLists
from tracer.acceleration.slabs import SMALLEST_COMPONENT
from tracer.acceleration.triangle import CONTACT_SLACK, Triangle, TriangleTables, fetch_triangle
from tracer.acceleration.walk import Node, octant_of, walk_within_root
from tracer.backends import Backend
from tracer.ray import max_abs, select_max, select_min
from tracer.shafts import Shaft

EDGE = 1e-5
"""How much too early or late, in shares of its length, a shaft may cross a box: rounding of the shares."""

CLEAR, DOUBTFUL, COVERED = range(3)
"""No triangle hides any sample; one may; one hides them all."""


def look_along(
    backend: Backend, tables: TriangleTables, shaft: Shaft, normal: Any, primitive: Any, active: Any
) -> Any:
    """What triangles do to a light (n,): `CLEAR`, `DOUBTFUL` or `COVERED`.

    `normal`: unit normal (3, n) on the lit side of the surface at the shafts' apex; `primitive`: its id.
    """

    def meet(slot: Any) -> Any:
        triangle, number = fetch_triangle(backend, tables.rows, slot)
        return dr.select(number != primitive, _meet(backend, triangle, shaft, normal), CLEAR)

    return first_verdict(backend, tables.lists, shaft, meet, active)


def first_verdict(
    backend: Backend, lists: NodeLists, shaft: Shaft, meet: Callable[[Any], Any], active: Any
) -> Any:
    """The first verdict (n,) of `meet(slot)` on what lies in the boxes that a shaft may cross that is not
    `CLEAR`."""
    slabs = _Slabs.of(backend, lists, shaft)

    def crosses(node: Node, verdict: Any) -> Any:
        return slabs.crossed(node)

    return walk_within_root(
        backend,
        lists,
        slabs.octant,
        crosses,
        test=lambda slot, verdict: meet(slot),
        active=active,
        state=dr.full(backend.UInt32, CLEAR, dr.width(shaft.apex)),
        done=lambda verdict: verdict != CLEAR,
    )


def _meet(backend: Backend, triangle: Triangle, shaft: Shaft, normal: Any) -> Any:
    """What one triangle does to the light."""
    a, b, c = triangle.v0 - shaft.apex, triangle.v1 - shaft.apex, triangle.v2 - shaft.apex
    size = select_max(select_max(max_abs(a), max_abs(b)), max_abs(c))
    slack = 2 * CONTACT_SLACK * backend.epsilon * select_max(size, max_abs(shaft.apex))
    height = -dr.dot(triangle.normal, a)
    other = height + dr.dot(triangle.normal, shaft.axis)
    reach = shaft.radius + slack + 2 * CONTACT_SLACK * backend.epsilon * max_abs(shaft.axis)
    before, behind = height > slack, height < -slack
    same_side = (before & (other > reach)) | (behind & (other < -reach))
    crosses = (before & (other < -reach)) | (behind & (other > reach))
    # The planes through the apex and an edge, turned so that the triangle lies on their positive side. The
    # height tells to which: a . (b x c) = -2 area height, but its own sign is noise for a sliver.
    faces = (dr.cross(b, c), dr.cross(c, a), dr.cross(a, b))
    turned = dr.select(before, backend.Float(-1), 1)
    edge_slack = 4 * slack * size * max_abs(shaft.axis)
    outside, inside = dr.full(backend.Bool, False, dr.width(a)), crosses
    for face in faces:
        distance = turned * dr.dot(face, shaft.axis)
        margin = dr.abs(distance) - edge_slack
        clear = (margin > 0) & (dr.square(margin) > dr.square(shaft.radius) * dr.squared_norm(face))
        outside = outside | (clear & (distance < 0) & (before | behind))
        inside = inside & clear & (distance > 0)
    rises = select_max(select_max(dr.dot(normal, a), dr.dot(normal, b)), dr.dot(normal, c)) > slack
    degenerate = dr.squared_norm(triangle.normal) == 0
    verdict = dr.select(inside & rises, backend.UInt32(COVERED), DOUBTFUL)
    return dr.select(same_side | outside | degenerate, CLEAR, verdict)


@dataclass
class _Slabs:
    """A shaft prepared for box tests.

    At the share t of its length the shaft is t R wide to every side. With D = |d|, and F and L the distances
    along an axis to the planes of a box that are crossed first and last, it is inside the box's slab where t
    (D + R) >= F and t (D - R) <= L. A share in [0, 1] must do so on all three axes.
    """

    octant: Any
    rate_first: Any
    shift_first: Any
    rate_last: Any
    shift_last: Any
    narrows: Any

    @staticmethod
    def of(backend: Backend, lists: NodeLists, shaft: Shaft) -> _Slabs:
        pad = 2 * CONTACT_SLACK * backend.epsilon * (max_abs(shaft.apex) + lists.extent)
        octant = octant_of(backend, shaft.axis)
        sign = backend.Vector3(*(dr.select(d < 0, backend.Float(-1), 1) for d in shaft.axis))
        length = dr.abs(shaft.axis)
        tiny = backend.epsilon * (length + shaft.radius) + SMALLEST_COMPONENT
        inverse_first = dr.rcp(length + shaft.radius + tiny)
        difference = length - shaft.radius
        narrows = difference > tiny  # else the limit is one on how early the shaft can be inside
        inverse_last = dr.rcp(dr.select(narrows, difference, select_min(difference, -tiny)))
        low, step = (0, 1) if lists.grid is None else (lists.grid.low, lists.grid.step)
        start = sign * (low - shaft.apex)
        return _Slabs(
            octant=octant,
            rate_first=sign * step * inverse_first,
            shift_first=(start - pad) * inverse_first,
            rate_last=sign * step * inverse_last,
            shift_last=(start + pad) * inverse_last,
            narrows=narrows,
        )

    def crossed(self, node: Node) -> Any:
        """Mask: the shaft may cross the box of the node."""
        first = dr.fma(node.first, self.rate_first, self.shift_first)
        last = dr.fma(node.last, self.rate_last, self.shift_last)
        entry, exit_ = type(first.x)(0), type(first.x)(1)
        for k in range(3):
            entry = select_max(entry, first[k])
            entry = dr.select(~self.narrows[k] & (last[k] > entry), last[k], entry)
            exit_ = dr.select(self.narrows[k] & (last[k] < exit_), last[k], exit_)
        return entry <= exit_ + EDGE
