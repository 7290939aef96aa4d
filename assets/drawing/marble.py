"""The picture of the ball with the 3-D texture: swirled bands, like those of a glass marble."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drawing.sheet import mean, rgb

SIZE = 512
FINE = 4
BANDS = ("#f7ead0", "#f2b56b", "#d9693f", "#8c2f45", "#3c2a5c", "#2f5f9e", "#58a9b8", "#cfe6d4")
VEIN = "#fff6e0"
_VEIN_SHARE = 0.07
# Each wave shifts y along x, then x along the new y: (waves across, waves down, phase, swing).
_WAVES = ((1, 1, 0.3, 0.50), (2, 3, 1.7, 0.30), (3, 2, 4.1, 0.22), (5, 4, 2.6, 0.11), (8, 7, 0.9, 0.05))


def draw() -> NDArray[np.uint8]:
    """512 x 512 texels that tile: all waves fit the edge a whole number of times."""
    count = SIZE * FINE
    turn = 2.0 * np.pi / count
    x, y = np.meshgrid((np.arange(count) + 0.5) * turn, (np.arange(count) + 0.5) * turn)
    for across, down, phase, swing in _WAVES:
        y = y + swing * np.sin(across * x + phase)
        x = x + 1.6 * swing * np.sin(down * y - phase)
    return mean(_colors(2.0 * y * len(BANDS) / (2.0 * np.pi)), FINE)


def _colors(place: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Bands of one color each, and a vein between two; `place` counts them and wraps around."""
    palette = np.array([rgb(color) for color in BANDS], dtype=np.uint8)
    band = np.floor(place)
    colors = palette[band.astype(np.int64) % len(BANDS)]
    colors[place - band < _VEIN_SHARE] = rgb(VEIN)
    return colors
