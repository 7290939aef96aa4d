"""The finished picture as depth of field reads it: by pixel, and by distance from the eye."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from tracer.backends import Backend
from tracer.canvas import Canvas

SEARCHED = (1 << 24, 1 << 30)
"""Pixels among which the similar ones are searched, the real ones or more: each of the two is a kernel of its
own, and not every number of pixels that are not blank."""


@dataclass
class FirstPass:
    """The picture that the filter reads, in Dr.Jit memory, for the rectangle x0, y0 .. x1, y1.

    `by_distance`, where windows are large: distances from the eye in rising order, and the pixels that have
    them, row times 65536 plus column.
    """

    color: Any
    depth: Any
    x0: int
    y0: int
    x1: int
    y1: int
    by_distance: tuple[Any, Any] | None = None

    def index(self, backend: Backend, column: Any, row: Any) -> Any:
        """Place of a pixel of the full picture in the arrays."""
        width = backend.opaque_id(self.x1 - self.x0)
        return (row - backend.opaque_id(self.y0)) * width + (column - backend.opaque_id(self.x0))

    def sort_by_distance(self, backend: Backend, canvas: Canvas) -> None:
        """Fills `by_distance`; of equal distances the lower pixel comes first."""
        width = self.x1 - self.x0
        lane = dr.arange(backend.UInt32, width * (self.y1 - self.y0))
        row = lane // backend.opaque_id(width)
        column = lane - row * backend.opaque_id(width) + self.x0
        row = row + self.y0
        distance = (eye_distance(backend, canvas, column, row) + self.depth).numpy()
        order = np.argsort(np.where(self.depth.numpy() > 0, distance, np.inf), kind="stable")
        order = order[: np.count_nonzero(self.depth.numpy() > 0)]
        places = (row.numpy()[order] << np.uint32(16)) | column.numpy()[order]
        self.by_distance = backend.table(distance[order]), backend.id_table(places)

    def similar(self, backend: Backend, eye: Any, depth_range: Any) -> tuple[Any, Any]:
        """The pixels whose distance differs from `eye` (n,) by less than the range: their first place in the
        order, their count."""
        assert self.by_distance is not None
        distances = self.by_distance[0]
        end_of_search = next(size for size in SEARCHED if size >= dr.width(distances))
        count = backend.opaque_id(dr.width(distances))

        def difference(place: Any) -> Any:
            return dr.gather(backend.Float, distances, place, place < count) - eye

        begin = dr.binary_search(0, end_of_search, lambda i: (i < count) & (difference(i) <= -depth_range))
        end = dr.binary_search(0, end_of_search, lambda i: (i < count) & (difference(i) < depth_range))
        return backend.UInt32(begin), backend.UInt32(end) - backend.UInt32(begin)

    def admissible(
        self,
        backend: Backend,
        canvas: Canvas,
        column: Any,
        row: Any,
        eye: Any,
        depth_range: Any,
        active: Any,
    ) -> Any:
        """Mask: the pixel is not blank and its distance from the eye differs from `eye` by less than the
        range."""
        depth = dr.gather(backend.Float, self.depth, self.index(backend, column, row), active)
        distance = eye_distance(backend, canvas, column, row) + depth
        return (depth > 0) & (dr.abs(distance - eye) < depth_range)


def eye_distance(backend: Backend, canvas: Canvas, column: Any, row: Any) -> Any:
    """|P - e| for the centers of pixels."""
    size = backend.opaque(canvas.pixel_size)
    x = (backend.Float(column) + 0.5 - backend.opaque(canvas.width / 2)) * size
    y = (backend.Float(row) + 0.5 - backend.opaque(canvas.height / 2)) * size
    distance = backend.opaque(canvas.distance)
    return dr.sqrt(distance * distance + x * x + y * y)
