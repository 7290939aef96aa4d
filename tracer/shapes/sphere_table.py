"""Many spheres: a loop over a table, where unrolled code would grow with every sphere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from tracer.backends import Backend
from tracer.ray import Hit, Ray, Segment
from tracer.shafts import Ball, ball_around
from tracer.shapes.sphere import SphereSlot, contact_margin


@dataclass
class SphereTable:
    """`rows`: 4 floats a sphere (center, radius); `margins`, `primitives`: one each; `count`: width-1; `ball`
    holds them all."""

    backend: Backend
    rows: Any
    margins: Any
    primitives: Any
    count: Any
    ball: Ball

    @staticmethod
    def of(backend: Backend, rows: np.ndarray, primitives: np.ndarray) -> SphereTable:
        """The table of n spheres with `rows` (n, 4) and their primitive ids."""
        return SphereTable(
            backend,
            backend.table(rows),
            backend.table([contact_margin(row, backend.epsilon) for row in rows]),
            backend.id_table(primitives),
            backend.opaque_id(len(rows)),
            Ball.of(backend, ball_around(_extremes(rows), backend.epsilon)),
        )

    def closest(self, ray: Ray, hit: Hit, active: Any) -> Hit:
        """The nearest of `hit` and all spheres."""
        return self.fold(hit, active, lambda hit, sphere: sphere.closest(ray, hit, active), lambda hit: True)

    def blocks(self, segment: Segment, active: Any) -> Any:
        """Mask: a sphere lies strictly between the two ends."""
        start = dr.full(self.backend.Bool, False, dr.width(segment.length))
        return self.fold(
            start, active, lambda blocked, s: blocked | s.blocks(segment, active), lambda blocked: ~blocked
        )

    def fold(self, state: Any, active: Any, step: Callable[..., Any], unfinished: Callable[..., Any]) -> Any:
        """step(... step(step(state, sphere 0), sphere 1) ...), ended early where `unfinished` says no."""

        def body(i: Any, state: Any) -> tuple[Any, Any]:
            return i + 1, step(state, self._slot(i))

        index = dr.select(active, dr.zeros(self.backend.UInt32, dr.width(active)), self.count)
        _, state = dr.while_loop(
            state=(index, state),
            cond=lambda i, state: (i < self.count) & unfinished(state),
            body=body,
            label="spheres",
        )
        return state

    def _slot(self, i: Any) -> SphereSlot:
        row = dr.gather(self.backend.Vector4, self.rows, i)
        return SphereSlot(
            center=self.backend.Vector3(row.x, row.y, row.z),
            radius=row.w,
            margin=dr.gather(self.backend.Float, self.margins, i),
            primitive=dr.gather(self.backend.UInt32, self.primitives, i),
        )


def _extremes(rows: np.ndarray) -> np.ndarray:
    """(8 n, 3) the corners of the boxes around spheres."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return (rows[:, None, :3] + rows[:, None, 3:] * corners).reshape(-1, 3)
