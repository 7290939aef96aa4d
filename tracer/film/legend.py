"""The legend in the corner of a layer's picture: its name, what its colors mean, and what is blank."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from tracer.film.false_color import BLANK, LIGHT, MAPS, blank_of, color_map, id_colors, scales_of
from tracer.film.layout import IDS

Row = Sequence["str | NDArray[np.uint8]"]
"""Texts and bars of colors (n, 3), from left to right."""

PAPER, INK = (20, 20, 20), (235, 235, 235)
MOST_IDS = 8  # of which each has its color shown
FONT = cv2.FONT_HERSHEY_SIMPLEX


def with_legend(image: NDArray[np.uint8], layer: str, values: NDArray) -> NDArray[np.uint8]:
    """The picture of a layer (h, w, 3) with a legend in its lower left corner.

    Letters grow with the picture. One that is too small for them stays as it is.
    """
    panel = _panel(_rows(layer, values), size=min(max(image.shape[0] / 1100, 0.4), 2.0))
    height, width = panel.shape[:2]
    if height > image.shape[0] / 2 or width > image.shape[1]:
        return image
    drawn = image.copy()
    drawn[-height:, :width] = panel
    return drawn


def _rows(layer: str, values: NDArray) -> list[Row]:
    name = layer.split(".")[0]
    blank = blank_of(layer, values)
    rows: list[Row] = [[layer]]
    for k, scale in enumerate(scales_of(layer, values)):
        low, high = f"{scale.low:.4g}", f"{scale.high:.4g}"
        if name in IDS:
            rows += _ids(values[~blank], f"{scale.low:.0f} to {scale.high:.0f}")
        elif name in LIGHT:
            rows.append([f"{low} to {high}"])
        elif name in MAPS:
            rows.append([low, color_map(layer), high, *(["log"] * scale.logarithmic)])
        else:
            rows.append([scale.name, low, _primary(k), high])
    if blank.any():
        rows.append([np.array([BLANK], np.uint8), "none"])
    return rows


def _ids(found: NDArray, span: str) -> list[Row]:
    """The range of ids, and of few each with its color."""
    numbers = np.unique(found)
    if len(numbers) > MOST_IDS:
        return [[span]]
    return [[span], [part for number in numbers for part in (id_colors(number[None]), str(number))]]


def _primary(component: int) -> NDArray[np.uint8]:
    """From black to red, green or blue (256, 3)."""
    colors = np.zeros((256, 3), np.uint8)
    colors[:, component] = np.arange(256)
    return colors


def _panel(rows: Sequence[Row], size: float) -> NDArray[np.uint8]:
    """The rows as a picture (h, w, 3); `size` is that of the letters against OpenCV's own, 22 pixels high."""
    letter = round(22 * size)
    gap = max(2, letter // 3)
    drawn = [_side_by_side([_item(item, size, letter) for item in row], gap) for row in rows]
    width = max(row.shape[1] for row in drawn)
    filled = [np.concatenate((row, _paper(row.shape[0], width - row.shape[1])), axis=1) for row in drawn]
    spaced = [part for row in filled for part in (row, _paper(gap, width))]
    inside = np.concatenate([_paper(gap, width), *spaced])
    sides = _paper(inside.shape[0], gap)
    return np.concatenate((sides, inside, sides), axis=1)


def _side_by_side(items: Sequence[NDArray[np.uint8]], gap: int) -> NDArray[np.uint8]:
    spaced = [part for item in items for part in (item, _paper(item.shape[0], gap))]
    return np.concatenate(spaced[:-1], axis=1)


def _item(item: str | NDArray[np.uint8], size: float, letter: int) -> NDArray[np.uint8]:
    """A text or a bar as a picture of one height."""
    if isinstance(item, str):
        thickness = max(1, round(1.6 * size))
        (width, _), _ = cv2.getTextSize(item, FONT, size, thickness)
        drawn = _paper(letter + letter // 3, width)
        cv2.putText(drawn, item, (0, letter), FONT, size, INK, thickness, cv2.LINE_AA)
        return drawn
    length = 6 * letter if len(item) > 1 else letter
    drawn = _paper(letter + letter // 3, length)
    drawn[:letter] = item[np.arange(length) * len(item) // length]
    return drawn


def _paper(height: int, width: int) -> NDArray[np.uint8]:
    return np.full((height, width, 3), PAPER, np.uint8)
