"""A sheet of wallpaper: filled paths that wrap around its edges, so that the finished picture tiles.

Coordinates are texels, x to the right and y down, as in SVG. Shapes are rasterized without smoothing on a
grid that is `FINE` times finer, and `picture` takes the mean: edges are smooth, and all that follows the
rounding of the corners is whole-number arithmetic.
"""

from __future__ import annotations

import re

import cv2
import numpy as np
from numpy.typing import NDArray

Outline = NDArray[np.float64]
"""Corners of a closed polygon, (n, 2)."""

FINE = 6
_FRACTION_BITS = 4
_CURVE_STEPS = 24


def rgb(color: str) -> tuple[int, int, int]:
    """The three numbers 0 to 255 of `#rrggbb`."""
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)


def path(text: str) -> Outline:
    """The points of an SVG path of absolute commands M, L and C (a cubic Bezier curve)."""
    points: list[NDArray[np.float64]] = []
    for command, numbers in re.findall(r"([MLC])([^MLC]*)", text):
        corners = np.array([float(word) for word in numbers.split()]).reshape(-1, 2)
        if command == "C":
            for control in corners.reshape(-1, 3, 2):
                points.extend(_bezier(points[-1], *control))
        else:
            points.extend(corners)
    return np.array(points)


def _bezier(p: Outline, a: Outline, b: Outline, q: Outline) -> Outline:
    """Points of a cubic Bezier curve from p to q, without p."""
    t = (np.arange(1, _CURVE_STEPS + 1) / _CURVE_STEPS)[:, None]
    return (1 - t) ** 3 * p + 3 * t * (1 - t) ** 2 * a + 3 * t**2 * (1 - t) * b + t**3 * q


def ellipse(x: float, y: float, rx: float, ry: float | None = None) -> Outline:
    """An ellipse around (x, y); a circle without `ry`."""
    angle = np.linspace(0.0, 2.0 * np.pi, 96, endpoint=False)
    return np.stack([x + rx * np.cos(angle), y + (rx if ry is None else ry) * np.sin(angle)], axis=1)


def mirrored(outline: Outline) -> Outline:
    """The outline with left and right exchanged."""
    return outline * [-1.0, 1.0]


def mean(fine: NDArray[np.uint8], factor: int) -> NDArray[np.uint8]:
    """Each texel is the rounded mean of `factor` x `factor` fine ones; whole-number arithmetic."""
    height, width = fine.shape[0] // factor, fine.shape[1] // factor
    rows = fine.reshape(height, factor, width * factor * 3).sum(axis=1, dtype=np.uint32)
    cells = rows.reshape(height, width, factor, 3).sum(axis=2)
    count = factor * factor
    return ((cells + count // 2) // count).astype(np.uint8)


class Sheet:
    """A picture of `width` x `height` texels whose opposite edges fit together."""

    def __init__(self, width: int, height: int, color: str) -> None:
        self.width, self.height = width, height
        self._fine = np.full((height * FINE, width * FINE, 3), rgb(color), np.uint8)
        self._origin, self._turn, self._size, self._flip = (0.0, 0.0), 0.0, 1.0, False

    def place(self, x: float, y: float, size: float = 1.0, turn: float = 0.0, flip: bool = False) -> Sheet:
        """Puts the origin of what is drawn next at (x, y): enlarged, turned clockwise (degrees), mirrored."""
        self._origin, self._turn, self._size, self._flip = (x, y), turn, size, flip
        return self

    def fill(self, outline: Outline, color: str, wrap: str = "xy") -> None:
        """Fills the outline, and its copies a sheet's width (`x`) and height (`y`) away."""
        for dx in (-self.width, 0, self.width) if "x" in wrap else (0,):
            for dy in (-self.height, 0, self.height) if "y" in wrap else (0,):
                corners = (self._placed(outline) + [dx, dy]) * FINE * (1 << _FRACTION_BITS)
                whole = np.rint(corners).astype(np.int32)
                cv2.fillPoly(self._fine, [whole], rgb(color), cv2.LINE_8, _FRACTION_BITS)

    def line(self, stroke: Outline, width: float, color: str, wrap: str = "xy") -> None:
        """A stroke of constant width with round ends: one capsule for each piece."""
        for start, end in zip(stroke[:-1], stroke[1:], strict=True):
            across = end - start
            normal = np.array([-across[1], across[0]]) / np.hypot(*across) * width / 2.0
            self.fill(np.array([start + normal, end + normal, end - normal, start - normal]), color, wrap)
        for joint in stroke:
            self.fill(ellipse(joint[0], joint[1], width / 2.0), color, wrap)

    def picture(self) -> NDArray[np.uint8]:
        """The finished sheet, (height, width, 3), red first."""
        return mean(self._fine, FINE)

    def _placed(self, outline: Outline) -> Outline:
        angle = np.radians(self._turn)
        cosine, sine = np.cos(angle), np.sin(angle)
        upright = mirrored(outline) if self._flip else outline
        turned = upright @ np.array([[cosine, sine], [-sine, cosine]])
        return turned * self._size + self._origin
