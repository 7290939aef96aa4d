"""Which lane owns which pixel: 8x8 tiles in Morton order, row of tiles by row of tiles.

Neighboring lanes then trace neighboring rays. A picture is launched in bands of whole tile rows, or in pieces
of a tile row where a whole one is too much at once; no band decides anything about a pixel, so every size of
them gives the same picture.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from tracer.backends import Backend

TILE = 8
_PIXELS = TILE * TILE

_PLACES = np.arange(_PIXELS)
_MORTON = np.sum([((_PLACES >> bit) & 1) << (bit // 2 + 3 * (bit % 2)) for bit in range(6)], axis=0)
"""For each lane of a tile its row times 8 plus its column: the bits of column and row in turn."""

FEWEST_PIXELS = 2 * _PIXELS
"""Of a launch; see `_tiles_across`."""

Rectangle = tuple[int, int, int, int]
"""x0, y0, x1, y1 in pixels of the full picture, end exclusive."""


@dataclass(frozen=True)
class Band:
    """The pixels of one launch: columns x0 .. x1 - 1 and rows y0 .. y1 - 1 of the picture."""

    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def width(self) -> int:
        """Columns."""
        return self.x1 - self.x0

    @property
    def height(self) -> int:
        """Rows."""
        return self.y1 - self.y0


def bands(rectangle: Rectangle, sub_rays: int, rays_per_band: int) -> Iterator[Band]:
    """Cuts a rectangle into bands of at most so many primary rays, from left to right and from the top down.

    Bands are whole tile rows; where not even one may be launched at once they are pieces of it, two tiles
    wide at least. So there are no more than four sizes, each of which is a recording of its own.
    """
    x0, y0, x1, y1 = rectangle
    tiles = max(2, rays_per_band // (_PIXELS * sub_rays))
    rows, columns = tiles // _tiles_across(x1 - x0), tiles
    width, height = (x1 - x0, rows * TILE) if rows > 0 else (columns * TILE, TILE)
    for top in range(y0, y1, height):
        for left in range(x0, x1, width):
            yield Band(left, top, min(left + width, x1), min(top + height, y1))


def after(rectangle: Rectangle, band: Band) -> list[Rectangle]:
    """What is left of a rectangle after this band and those before it: the rest of its rows, the rows below.

    They are cut by `bands` as the rectangle was, or, with another number of rays, otherwise.
    """
    x0, _, x1, y1 = rectangle
    rest = [(band.x1, band.y0, x1, band.y1), (x0, band.y1, x1, y1)]
    return [(left, top, right, bottom) for left, top, right, bottom in rest if left < right and top < bottom]


def _tiles_across(width: int) -> int:
    """Tiles in a row: two at least, which the division by multiplication below needs."""
    return max(2, -(-width // TILE))


def lane_count(width: int, height: int) -> int:
    """Lanes of a launch: all pixels of the tiles that cover a band of that size."""
    return _tiles_across(width) * -(-height // TILE) * _PIXELS


def few_lengths(count: int) -> int:
    """The next of few numbers of lanes, of whole tiles: between four and eight from a power of two to the
    next."""
    step = max(_PIXELS, 1 << max(0, count.bit_length() - 3))
    return -(-count // step) * step


def tile_order(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Columns and rows of the pixels of a mask (h, w), in the order of lanes."""
    height, width = (-(-size // TILE) for size in mask.shape)
    padded = np.zeros((height * TILE, width * TILE), bool)
    padded[: mask.shape[0], : mask.shape[1]] = mask
    tiles = padded.reshape(height, TILE, width, TILE).transpose(0, 2, 1, 3).reshape(-1, _PIXELS)
    tile, place = np.divmod(np.flatnonzero(tiles[:, _MORTON]), _PIXELS)
    row, column = np.divmod(tile, width)
    inner_row, inner_column = np.divmod(_MORTON[place], TILE)
    return column * TILE + inner_column, row * TILE + inner_row


def lane_pixels(backend: Backend, width: int, height: int, lane: Any) -> tuple[Any, Any, Any]:
    """Column and row of lanes (n,) within a band of that size, and the mask of those that own a pixel."""
    across = _tiles_across(width)
    tile, place = lane >> 6, lane & (_PIXELS - 1)
    # tile // across as a multiplication: exact while tiles times across stays below 2^32, as a band's do
    tile_row = dr.mul_hi(tile, backend.opaque_id(-(-(2**32) // across)))
    tile_column = tile - tile_row * backend.opaque_id(across)
    column = (tile_column << 3) + _even_bits(place)
    row = (tile_row << 3) + _even_bits(place >> 1)
    active = (column < backend.opaque_id(width)) & (row < backend.opaque_id(height))
    return column, row, active


def _even_bits(place: Any) -> Any:
    """Bits 0, 2, 4 of a number below 64, side by side (Morton order)."""
    return (place & 1) | ((place >> 1) & 2) | ((place >> 2) & 4)
