"""Many spheres: a hierarchy over them, where unrolled code would grow with every sphere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from tracer.acceleration.build import build_over_boxes
from tracer.acceleration.layout import NodeLists, threaded
from tracer.acceleration.slabs import Slabs
from tracer.acceleration.walk import Node, walk_within_root
from tracer.backends import Backend
from tracer.ray import Hit, Ray, Segment
from tracer.shafts import Ball, ball_around
from tracer.shapes.sphere import SphereSlot, contact_margin

WIDTH = 64
"""Boxes are widened by this many eps of the largest coordinate in play. A hit may lie 34 outside of its
sphere: a ray that leaves it starts within 8, and the distance to the closest approach, which rounds by 13,
counts twice on the way to the other side. The planes of a box round by 11."""


@dataclass
class SphereRows:
    """Spheres in Dr.Jit memory: `rows`, 4 floats each (center, radius), `margins` and `primitives`, one
    each."""

    backend: Backend
    rows: Any
    margins: Any
    primitives: Any

    @staticmethod
    def of(backend: Backend, rows: np.ndarray, primitives: np.ndarray) -> SphereRows:
        """Of n >= 1 spheres with `rows` (n, 4) and their primitive ids."""
        return SphereRows(
            backend=backend,
            rows=backend.table(rows),
            margins=backend.table([contact_margin(row, backend.epsilon) for row in rows]),
            primitives=backend.id_table(primitives),
        )

    def fetch(self, slot: Any) -> SphereSlot:
        """The sphere in a row."""
        row = dr.gather(self.backend.Vector4, self.rows, slot)
        return SphereSlot(
            center=self.backend.Vector3(row.x, row.y, row.z),
            radius=row.w,
            margin=dr.gather(self.backend.Float, self.margins, slot),
            primitive=dr.gather(self.backend.UInt32, self.primitives, slot),
        )


@dataclass
class SphereTable:
    """All spheres of a scene, in the order of the leaves; `lists`: the hierarchy over them; `ball`: holds
    all."""

    backend: Backend
    spheres: SphereRows
    lists: NodeLists
    ball: Ball

    @staticmethod
    def of(backend: Backend, rows: np.ndarray, primitives: np.ndarray) -> SphereTable:
        """The table of n >= 1 spheres with `rows` (n, 4) and their primitive ids."""
        lower, upper = sphere_boxes(rows.astype(backend.dtype))
        tree = build_over_boxes(backend, lower, upper)
        return SphereTable(
            backend=backend,
            spheres=SphereRows.of(backend, rows[tree.order], primitives[tree.order]),
            lists=threaded(backend, tree),
            ball=Ball.of(backend, ball_around(_corners(lower, upper), backend.epsilon)),
        )

    def closest(self, ray: Ray, hit: Hit, active: Any) -> Hit:
        """The nearest of `hit` and all spheres."""
        return self._visit(
            ray,
            limit=lambda hit: hit.t,
            state=hit,
            active=active,
            step=lambda hit, sphere: sphere.closest(ray, hit, active),
        )

    def blocks(self, segment: Segment, active: Any) -> Any:
        """Mask: a sphere lies strictly between the two ends."""
        return self.fold(
            segment,
            state=dr.full(self.backend.Bool, False, dr.width(segment.length)),
            active=active,
            step=lambda blocked, sphere: blocked | sphere.blocks(segment, active),
            done=lambda blocked: blocked,
        )

    def fold(
        self,
        segment: Segment,
        state: Any,
        active: Any,
        step: Callable[[Any, SphereSlot], Any],
        done: Callable[[Any], Any],
    ) -> Any:
        """step(... step(step(state, sphere), sphere) ...) over all spheres that may lie between the two ends,
        in any order, until `done(state)` says so."""
        return self._visit(segment.ray, lambda state: segment.length, state, active, step, done)

    def _visit(
        self,
        ray: Ray,
        limit: Callable[[Any], Any],
        state: Any,
        active: Any,
        step: Callable[[Any, SphereSlot], Any],
        done: Callable[[Any], Any] | None = None,
    ) -> Any:
        """Steps through the spheres whose boxes a ray meets up to `limit(state)`, nearest boxes first."""
        backend, lists = self.backend, self.lists
        slabs = Slabs.of(backend, lists, ray, WIDTH)

        def crosses(node: Node, state: Any) -> Any:
            return slabs.crossed(node, limit(state))

        return walk_within_root(
            backend,
            lists,
            slabs.octant,
            crosses,
            test=lambda slot, state: step(state, self.fetch(slot)),
            active=active,
            state=state,
            done=done,
        )

    def fetch(self, slot: Any) -> SphereSlot:
        """The sphere in a slot of the hierarchy."""
        return self.spheres.fetch(slot)


def sphere_boxes(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Boxes `lower`, `upper` (n, 3) around spheres with `rows` (n, 4), in single precision numbers, rounded
    outwards."""
    center, radius = rows[:, :3].astype(np.float64), rows[:, 3:].astype(np.float64)
    lower, upper = (center - radius).astype(np.float32), (center + radius).astype(np.float32)
    return np.nextafter(lower, np.float32(-np.inf)), np.nextafter(upper, np.float32(np.inf))


def _corners(lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """(8 n, 3) the corners of boxes, in double precision."""
    chosen = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], bool)
    return np.where(chosen, upper[:, None], lower[:, None]).astype(np.float64).reshape(-1, 3)
