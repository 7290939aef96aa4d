"""The depth buffer as a picture: near is bright, far is dark, blank is a checkerboard.

A plane that runs to the horizon is hundreds of times as deep as what stands on it, so a linear scale would
show the horizon alone. The brightness is s / (s + d - near) with s = median - near, stretched so that the
farthest point is the dark end. It gives the near half of the pixels most of the scale, and would still have a
place for a point at infinity.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

FLAT = 1e-4
"""A span of depths below this share of the farthest is shown as one color: the scale would show rounding."""
LEAST_SOFTENING = 1e-2
"""The least s, as a share of the median: where most pixels are equally near, the rest must still differ."""
CELLS_ACROSS = 40
GRAYS = (118, 158)  # of the checkerboard; viridis has no gray


@dataclass(frozen=True)
class DepthScale:
    """From depth to brightness, 1 (near) to 0 (far), and back."""

    near: float
    median: float
    far: float
    blank: float  # share of the pixels that hit nothing, 0 to 1

    @classmethod
    def of(cls, depth: NDArray[np.floating]) -> DepthScale:
        """The scale of a depth buffer (h, w) in which at least one pixel hits something."""
        hit = depth[depth >= 0].astype(float)
        if hit.size == 0:
            raise ValueError("no pixel of the depth buffer hits anything; allowed: at least one hit")
        return cls(hit.min(), float(np.median(hit)), hit.max(), 1 - hit.size / depth.size)

    @property
    def is_flat(self) -> bool:
        """Whether all points are equally far, up to rounding and the obliqueness of rays."""
        return self.far - self.near <= FLAT * self.far

    @property
    def _softening(self) -> float:
        """The s of the formula; a median of 0 (a plane in the canvas) leaves the farthest as a measure."""
        return max(self.median - self.near, LEAST_SOFTENING * self.median) or self.far

    @property
    def _darkest(self) -> float:
        """The brightness of the farthest point before stretching."""
        return self._softening / (self._softening + self.far - self.near)

    def brightness(self, depth: NDArray[np.floating]) -> NDArray[np.floating]:
        """1 at the nearest point, 0 at the farthest; a flat scale gives 1 everywhere. Any shape."""
        if self.is_flat:
            return np.ones_like(depth)
        raw = self._softening / (self._softening + np.maximum(depth - self.near, 0))
        return np.clip((raw - self._darkest) / (1 - self._darkest), 0, 1)

    def depth(self, brightness: float) -> float:
        """The depth that has a brightness from 0 to 1."""
        raw = self._darkest + brightness * (1 - self._darkest)
        return self.near + self._softening * (1 / raw - 1)


def paint(depth: NDArray[np.floating], scale: DepthScale) -> NDArray[np.uint8]:
    """The depth buffer (h, w) in viridis, (h, w, 3) in OpenCV's order of colors."""
    height, width = depth.shape
    colors = _viridis(scale.brightness(depth))
    cell = max(width // CELLS_ACROSS, 1)
    rows, columns = np.mgrid[:height, :width] // cell
    board = np.where((rows + columns) % 2 == 0, *GRAYS)
    return np.where((depth >= 0)[..., None], colors, board[..., None]).astype(np.uint8)


def colors_of_the_bar(count: int) -> list[str]:
    """`count` colors from near to far, evenly spaced in brightness, as `#rrggbb`."""
    (row,) = _viridis(np.linspace(1, 0, count)[None])
    return [f"#{red:02x}{green:02x}{blue:02x}" for blue, green, red in row.tolist()]


def _viridis(brightness: NDArray[np.floating]) -> NDArray[np.uint8]:
    levels = np.floor(255 * brightness + 0.5).astype(np.uint8)
    return np.asarray(cv2.applyColorMap(levels, cv2.COLORMAP_VIRIDIS), np.uint8)
