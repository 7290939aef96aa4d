"""The finished picture as depth of field reads it: by pixel, and by distance from the eye."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from tracer.backends import Backend
from tracer.canvas import Canvas
from tracer.tiles import Rectangle

SEARCHED = (1 << 24, 1 << 30)
"""Pixels among which the similar ones are searched, those of the picture or more: each of the two is a kernel
of its own, and not every number of pixels."""


@dataclass
class FirstPass:
    """The picture that the filter reads, in Dr.Jit memory, for the rectangle x0, y0 .. x1, y1.

    `distances` from the eye in rising order, and the `pixels` that have them, row times 65536 plus column;
    where no window is large, two of which nobody draws, so that it is the same kernel.
    """

    color: Any
    depth: Any
    x0: int
    y0: int
    x1: int
    y1: int
    distances: Any
    pixels: Any

    @staticmethod
    def of(
        backend: Backend, color: np.ndarray, depth: np.ndarray, source: Rectangle, canvas: Canvas, large: bool
    ) -> FirstPass:
        """From colors (h, w, 3) and depths (h, w) of a rectangle; `large`: some window is."""
        distances, pixels = _by_distance(depth, source, canvas) if large else (np.zeros(2), np.zeros(2))
        tables = backend.table(distances), backend.id_table(pixels)
        return FirstPass(backend.table(color), backend.table(depth), *source, *tables)

    def index(self, backend: Backend, column: Any, row: Any) -> Any:
        """Place of a pixel of the full picture in the arrays."""
        width = backend.opaque_id(self.x1 - self.x0)
        return (row - backend.opaque_id(self.y0)) * width + (column - backend.opaque_id(self.x0))

    def similar(self, backend: Backend, canvas: Canvas, eye: Any, depth_range: Any) -> tuple[Any, Any]:
        """The pixels whose distance differs from `eye` (n,) by less than the range: their first place in the
        order, their count."""
        end_of_search = next(size for size in SEARCHED if size >= canvas.width * canvas.height)
        count = backend.opaque_id(dr.width(self.distances))

        def difference(place: Any) -> Any:
            return dr.gather(backend.Float, self.distances, place, place < count) - eye

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


def _by_distance(depth: np.ndarray, source: Rectangle, canvas: Canvas) -> tuple[np.ndarray, np.ndarray]:
    """Distances from the eye in rising order, and the pixels that have them, row times 65536 plus column;
    of equal distances the lower pixel comes first. `depth` (h, w): of `source`."""
    rows, columns = np.nonzero(depth > 0)
    own = depth[rows, columns].astype(np.float64)
    columns, rows = columns + source[0], rows + source[1]
    distance = np.sqrt(_squared_distance(_numbers(canvas), columns, rows)) + own  # rounded as in the kernel
    order = np.argsort(distance, kind="stable")
    return distance[order], (rows << 16 | columns)[order]


def eye_distance(backend: Backend, canvas: Canvas, column: Any, row: Any) -> Any:
    """|P - e| for the centers of pixels."""
    numbers = [backend.opaque(number) for number in _numbers(canvas)]
    return dr.sqrt(_squared_distance(numbers, backend.Float(column), backend.Float(row)))


def _numbers(canvas: Canvas) -> tuple[float, ...]:
    """Of a canvas: the size of a pixel, half the width and half the height in pixels, distance of the eye."""
    return canvas.pixel_size, canvas.width / 2, canvas.height / 2, canvas.distance


def _squared_distance(numbers: Sequence[Any], column: Any, row: Any) -> Any:
    """|P - e|², on the host as in kernels; `numbers`: those of the canvas."""
    size, half_width, half_height, distance = numbers
    x, y = (column + 0.5 - half_width) * size, (row + 0.5 - half_height) * size
    return distance * distance + x * x + y * y
