"""Which pixels a launch traces, and their primary rays (document, section 7)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.backends import Backend
from tracer.canvas import DeviceCanvas
from tracer.tiles import lane_count, lane_pixels


@dataclass
class BandPlace:
    """Where a band lies: its first column and row, the `width` of the full picture; `n`: each pixel is the
    mean of n x n sub-rays. Width-1 numbers."""

    x0: Any
    y0: Any
    width: Any
    n: Any


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


def pixels_of(backend: Backend, place: BandPlace, size: tuple[int, int], lane: Any) -> PixelGrid:
    """The pixels of lanes (n,) in a band of `size` columns and rows."""
    column, row, active = lane_pixels(backend, *size, lane)
    column, row = column + place.x0, row + place.y0
    lanes = backend.opaque_id(lane_count(*size))
    return PixelGrid(lane, lanes, column, row, row * place.width + column, place.n, active)


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
    backend: Backend, canvas: DeviceCanvas, place: BandPlace, size: tuple[int, int], number: Any
) -> tuple[PixelGrid, Any, Any]:
    """Pixels, origins and directions (3, n) of the rays of a band by number: sub-ray times lanes plus
    lane."""
    launch = backend.opaque_id(lane_count(*size))
    sub_ray = number // launch
    pixels = pixels_of(backend, place, size, number - sub_ray * launch)
    return pixels, *primary_ray(backend, canvas, pixels, sub_ray)
