"""POV-Ray's coordinates, and numbers as its scene language has them.

POV-Ray is left-handed: z changes its sign. Its tolerances are lengths (a shadow ray starts 0.001 away from
the surface), so small scenes are enlarged, by a power of two, which rounds nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

SMALLEST, LARGEST = 256.0, 1e6
"""Sizes of scenes that are written as they are; others are brought next to `USUAL`."""

USUAL = 1024.0


@dataclass(frozen=True)
class Space:
    """From the scene's coordinates to POV-Ray's: z is mirrored, lengths are multiplied by `unit`."""

    unit: float

    @staticmethod
    def of(extent: float) -> Space:
        """The space for a scene of that size."""
        if SMALLEST <= extent <= LARGEST or extent <= 0:
            return Space(1.0)
        return Space(2.0 ** round(math.log2(USUAL / extent)))

    def points(self, points: np.ndarray) -> np.ndarray:
        """Points or vectors (..., 3) with lengths."""
        return points * (self.unit * np.array([1.0, 1.0, -1.0]))

    def point(self, point: np.ndarray) -> str:
        """One point or vector with a length, as text."""
        return vector(self.points(np.asarray(point, np.float64)))

    def direction(self, direction: np.ndarray) -> str:
        """A unit vector as text."""
        return vector(direction * np.array([1.0, 1.0, -1.0]))

    def length(self, length: float) -> str:
        """A length as text."""
        return number(self.unit * length)

    def pattern(self, to_pattern: np.ndarray) -> str:
        """The transformation of a texture that is looked up at `to_pattern` (3, 4) times the scene's
        (x, y, z, 1)."""
        whole = np.eye(4)
        whole[:3] = to_pattern
        back = np.diag([self.unit, self.unit, -self.unit, 1.0]) @ np.linalg.inv(whole)
        return f"matrix <{', '.join(number(x) for x in back[:3].T.ravel())}>"


def number(value: float) -> str:
    """A number without loss; negative zero is zero."""
    return repr(float(value) + 0.0).removesuffix(".0")


def vector(values: np.ndarray) -> str:
    """<a, b, c>."""
    return f"<{', '.join(number(x) for x in values)}>"
