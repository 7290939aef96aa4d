"""Which pixels a launch traces, and their primary rays (document, section 7)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import drjit as dr
import numpy as np

from tracer.backends import INVALID, Backend
from tracer.canvas import DeviceCanvas
from tracer.tiles import Band, few_lengths, lane_count, lane_pixels


@dataclass
class PixelGrid:
    """The pixels of lanes: `lane` (n,) of the `lanes` (width 1) of a launch, `column`, `row` (n,) whole
    numbers, `number` (n,) row times width plus column of the full picture, `n`: a pixel is the mean of n x n
    sub-rays (width 1), `active`: the lane owns a pixel."""

    lane: Any
    lanes: Any
    column: Any
    row: Any
    number: Any
    n: Any
    active: Any


class Lanes(Protocol):
    """Which pixels the lanes of a launch own, and where what they find is put."""

    @property
    def count(self) -> int:
        """How many lanes there are."""

    @property
    def room(self) -> int:
        """How many pixels the result of the launch has."""

    def pixels(self, backend: Backend, lane: Any) -> PixelGrid:
        """The pixels of lanes (n,)."""

    def places(self, backend: Backend, pixels: PixelGrid) -> Any:
        """The places (n,) of pixels in the result."""


@dataclass
class BandLanes:
    """The pixels of a band of `size` columns and rows, result in the order of the picture. Width-1 numbers:
    the band's first column and row, the `width` of the full picture; `n`: each pixel is the mean of n x n
    sub-rays."""

    x0: Any
    y0: Any
    width: Any
    n: Any
    size: tuple[int, int]

    @staticmethod
    def of(backend: Backend, band: Band, width: int, n: int) -> BandLanes:
        """Those of a band in a picture of that width."""
        x0, y0, wide, sub_rays = (backend.opaque_id(value) for value in (band.x0, band.y0, width, n))
        return BandLanes(x0, y0, wide, sub_rays, (band.width, band.height))

    @property
    def count(self) -> int:
        """See `Lanes`."""
        return lane_count(*self.size)

    @property
    def room(self) -> int:
        """See `Lanes`."""
        return self.size[0] * self.size[1]

    def pixels(self, backend: Backend, lane: Any) -> PixelGrid:
        """See `Lanes`."""
        column, row, active = lane_pixels(backend, *self.size, lane)
        column, row = column + self.x0, row + self.y0
        lanes = backend.opaque_id(self.count)
        return PixelGrid(lane, lanes, column, row, row * self.width + column, self.n, active)

    def places(self, backend: Backend, pixels: PixelGrid) -> Any:
        """See `Lanes`."""
        return (pixels.row - self.y0) * backend.opaque_id(self.size[0]) + (pixels.column - self.x0)


@dataclass
class ListedLanes:
    """Pixels from a list: `column`, `row` and `place` in the result (`INVALID`: the lane owns none), (count,)
    each; `room`: see `Lanes`. Which pixels are listed is no part of a kernel, and neither is how many."""

    column: Any
    row: Any
    place: Any
    room: int
    width: Any
    n: Any

    @staticmethod
    def of_band(backend: Backend, band: Band, width: int, n: int) -> ListedLanes:
        """The lanes of a band, as `BandLanes`, as a list."""
        lanes = BandLanes.of(backend, band, width, n)
        pixels = lanes.pixels(backend, dr.arange(backend.UInt32, lanes.count))
        place = dr.select(pixels.active, lanes.places(backend, pixels), INVALID)
        dr.eval(pixels.column, pixels.row, place)
        return ListedLanes(pixels.column, pixels.row, place, lanes.room, lanes.width, lanes.n)

    @staticmethod
    def of_pixels(backend: Backend, columns: np.ndarray, rows: np.ndarray, width: int, n: int) -> ListedLanes:
        """Pixels (k,) in this order, which is that of the result; its room, and the number of lanes, is one
        of few, since each length is recorded for itself."""
        count = few_lengths(len(columns))
        owners = np.minimum(np.arange(count), len(columns) - 1)  # bundles end with neighbors, too
        place = np.where(np.arange(count) < len(columns), owners, INVALID)
        column, row, place = map(backend.id_table, (columns[owners], rows[owners], place))
        return ListedLanes(column, row, place, count, backend.opaque_id(width), backend.opaque_id(n))

    @property
    def count(self) -> int:
        """See `Lanes`."""
        return len(self.place)

    def pixels(self, backend: Backend, lane: Any) -> PixelGrid:
        """See `Lanes`."""
        index = backend.UInt32
        column, row = dr.gather(index, self.column, lane), dr.gather(index, self.row, lane)
        active = dr.gather(index, self.place, lane) != INVALID
        lanes = backend.opaque_id(self.count)
        return PixelGrid(lane, lanes, column, row, row * self.width + column, self.n, active)

    def places(self, backend: Backend, pixels: PixelGrid) -> Any:
        """See `Lanes`."""
        return dr.gather(backend.UInt32, self.place, pixels.lane)


def primary_ray(backend: Backend, canvas: DeviceCanvas, pixels: PixelGrid, sub_ray: Any) -> tuple[Any, Any]:
    """Origin and direction of a sub-ray (document, section 7)."""
    n, number = backend.Float(pixels.n), backend.Float(sub_ray)
    # Exact for at most 64 x 64 sub-rays; a division of whole numbers costs 20 times as much.
    b = dr.floor((number + 0.5) / n)
    a = number - b * n
    column = backend.Float(pixels.column) + (a + canvas.offset) / n
    row = backend.Float(pixels.row) + (b + canvas.offset) / n
    return canvas.ray(column, row)


def numbered_rays(
    backend: Backend, canvas: DeviceCanvas, lanes: Lanes, number: Any
) -> tuple[PixelGrid, Any, Any]:
    """Pixels, origins and directions (3, n) of the rays of a launch by number: sub-ray times lanes plus
    lane."""
    launch = backend.opaque_id(lanes.count)
    sub_ray = number // launch
    pixels = lanes.pixels(backend, number - sub_ray * launch)
    return pixels, *primary_ray(backend, canvas, pixels, sub_ray)
