"""Which pixels of a picture differ from their neighbors, to the right, to the left, above or below."""

from __future__ import annotations

import numpy as np

from tracer.color import encode_srgb
from tracer.film.film import Film
from tracer.tiles import TILE, Rectangle, tile_order

ROWS = 8 * TILE
"""That are looked at together, so that copies of them are small; whole tiles."""

MARGIN = 1
"""Pixels around a rectangle that decide along with it."""


def differing_pixels(
    film: Film, rectangle: Rectangle, threshold: float, linear: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Columns and rows (k,) in the picture of the pixels of a rectangle whose color, or coverage, differs by
    the threshold or more from a neighbor's; in the order of lanes.

    Colors are compared by display values, and all above 1 are the same; `linear`: those of the film are not
    display-referred. The film holds the rectangle and `MARGIN` around it, as far as the picture goes.
    """
    x0, y0, x1, y1 = rectangle
    left, above = film.rectangle[:2]
    found = []
    for top in range(y0, y1, ROWS):
        end = min(top + ROWS, y1)
        low, first = max(above, top - MARGIN), max(left, x0 - MARGIN)
        window = slice(low - above, end + MARGIN - above), slice(first - left, x1 + MARGIN - left)
        color = film.color[window]
        shown = np.clip(encode_srgb(color) if linear else color, 0, 1)
        differs = _differs([*np.moveaxis(shown, 2, 0), film.alpha[window]], threshold)
        column, row = tile_order(differs[top - low : end - low, x0 - first : x1 - first])
        found.append((column + x0, row + top))
    columns, rows = zip(*found, strict=True)
    return np.concatenate(columns).astype(np.uint32), np.concatenate(rows).astype(np.uint32)


def _differs(channels: list[np.ndarray], threshold: float) -> np.ndarray:
    """Mask (h, w) of the pixels that differ from a neighbor by the threshold or more in a channel (h, w)."""
    mask = np.zeros(channels[0].shape, bool)
    across, down = mask[:, 1:].copy(), mask[1:].copy()
    for channel in channels:
        across |= np.abs(np.diff(channel, axis=1)) >= threshold
        down |= np.abs(np.diff(channel, axis=0)) >= threshold
    mask[:, 1:] |= across
    mask[:, :-1] |= across
    mask[1:] |= down
    mask[:-1] |= down
    return mask
