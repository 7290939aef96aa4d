"""The picture under way, in host memory."""

from __future__ import annotations

from typing import Any

import numpy as np

from tracer.film.layout import VISIBILITY
from tracer.row_blocks import copy_together
from tracer.tiles import Band, Rectangle

BLANK = {"color": 0, "alpha": 0, "depth": -1, "z": np.inf, "shape": -1, "primitive": -1} | dict.fromkeys(
    ("level", "rays", "ambient", "diffuse", "specular", "reflected", "refracted"), 0
)
"""What a layer holds where nothing was traced yet; NaN for the others."""


class Film:
    """The layers of one rectangle of the picture.

    Layers are (h, w) or (h, w, components) by name: `color`, `alpha`, `depth`, `z` (from the canvas along the
    view axis) and those asked for. `counts`: rays by kind and how paths ended; `finished`: pixels so far.
    """

    def __init__(self, rectangle: Rectangle, dtype: Any, counts: dict[str, int]) -> None:
        self.rectangle, self.counts = rectangle, counts
        self.arrays: dict[str, np.ndarray] = {}
        self.finished = 0
        self._dtype = dtype

    @property
    def pixels(self) -> int:
        """All of them."""
        x0, y0, x1, y1 = self.rectangle
        return (x1 - x0) * (y1 - y0)

    def blank_copy(self, rectangle: Rectangle) -> Film:
        """A film of another rectangle, with the same counts, that holds nothing."""
        return Film(rectangle, self._dtype, self.counts)

    def take(self, band: Band, layers: dict[str, np.ndarray]) -> None:
        """Adds a finished band; each array holds its pixels in order, components last."""
        x0, y0, x1, y1 = self.rectangle
        self.finished += band.width * band.height
        found = {name: _pixels(name, values, band) for name, values in layers.items()}
        if (band.width, band.height) == (x1 - x0, y1 - y0):
            self.arrays |= found
            return
        for name, pixels in found.items():
            if name not in self.arrays:
                shape = (y1 - y0, x1 - x0, *pixels.shape[2:])
                self.arrays[name] = np.full(shape, BLANK.get(name, np.nan), pixels.dtype)
        copy_together([(self.arrays[name][self._place(band)], pixels) for name, pixels in found.items()])

    def part(self, band: Band) -> dict[str, np.ndarray]:
        """The layers of a finished band, as `take` takes them but for their shape; nothing is copied."""
        return {name: array[self._place(band)] for name, array in self.arrays.items()}

    def _place(self, band: Band) -> tuple[slice, slice]:
        x0, y0 = self.rectangle[:2]
        return slice(band.y0 - y0, band.y1 - y0), slice(band.x0 - x0, band.x1 - x0)

    def layer(self, name: str) -> np.ndarray:
        """A layer, blank where nothing was traced."""
        if name not in self.arrays:
            x0, y0, x1, y1 = self.rectangle
            shape = (y1 - y0, x1 - x0, 3) if name == "color" else (y1 - y0, x1 - x0)
            self.arrays[name] = np.full(shape, BLANK[name], self._dtype)
        return self.arrays[name]

    @property
    def color(self) -> np.ndarray:
        """(h, w, 3) in the color space of the shading."""
        return self.layer("color")

    @color.setter
    def color(self, values: np.ndarray) -> None:
        self.arrays["color"] = values

    @property
    def depth(self) -> np.ndarray:
        """(h, w), -1 blank."""
        return self.layer("depth")

    @property
    def alpha(self) -> np.ndarray:
        """(h, w), share of sub-rays that hit something."""
        return self.layer("alpha")

    @property
    def z(self) -> np.ndarray:
        """(h, w), from the eye along the view axis, infinite where blank."""
        return self.layer("z")


def _pixels(name: str, values: np.ndarray, band: Band) -> np.ndarray:
    """The values of a band as (h, w) or (h, w, components)."""
    pixels: np.ndarray = values.reshape(band.height, band.width, -1)
    return pixels[..., 0] if pixels.shape[2] == 1 and name != VISIBILITY else pixels
