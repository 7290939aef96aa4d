"""Where a shape stands: scale, then rotate, then translate (document, section 5), in double precision."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Placement:
    """The map p -> linear p + shift. `linear` (3, 3) = rotation times scale, `shift` (3,)."""

    rotation: np.ndarray
    scale: np.ndarray
    shift: np.ndarray

    @staticmethod
    def of(
        scale: float | tuple[float, float, float],
        rotate: tuple[float, float, float],
        translate: tuple[float, float, float],
    ) -> Placement:
        """The placement for factors (one or three), degrees about x, y, z and a shift."""
        if not any(rotate) and not any(translate) and scale in (1, (1, 1, 1)):
            return IDENTITY
        factors = np.broadcast_to(np.asarray(scale, np.float64), 3)
        return Placement(rotation_matrix(rotate), factors, np.asarray(translate, np.float64))

    @property
    def linear(self) -> np.ndarray:
        """The 3x3 part."""
        return self.rotation * self.scale

    def points(self, points: np.ndarray) -> np.ndarray:
        """Places points (n, 3)."""
        if self.is_identity:
            return points
        return points @ self.linear.T + self.shift

    def normals(self, normals: np.ndarray) -> np.ndarray:
        """Places normals (n, 3) by the inverse transpose; the result is not normalized."""
        return (normals / self.scale) @ self.rotation.T

    def inverse(self) -> np.ndarray:
        """The 3x4 matrix that takes a placed point back."""
        linear = self.rotation.T / self.scale[:, None]
        return np.column_stack([linear, -linear @ self.shift])

    @property
    def is_identity(self) -> bool:
        """True for a shape that was not moved; its coordinates then stay as they are, bit for bit."""
        return self is IDENTITY


IDENTITY = Placement(np.eye(3), np.ones(3), np.zeros(3))


def rotation_matrix(degrees: tuple[float, float, float]) -> np.ndarray:
    """Rotation by angles in degrees about x, then y, then z, right-handed; quarter turns are exact."""
    x, y, z = (_turn(axis, angle) for axis, angle in enumerate(degrees))
    return z @ y @ x


def _turn(axis: int, degrees: float) -> np.ndarray:
    cos, sin = cosine_sine(degrees)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = cos
    matrix[i, j], matrix[j, i] = -sin, sin
    return matrix


def cosine_sine(degrees: float) -> tuple[float, float]:
    """(cos, sin) of an angle in degrees, exact at multiples of 90."""
    quarter, rest = divmod(degrees, 90.0)
    if rest == 0.0:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarter) % 4]
    angle = np.radians(degrees)
    return float(np.cos(angle)), float(np.sin(angle))


def turned_about(vector: NDArray, axis: NDArray, degrees: float) -> NDArray:
    """A vector (3,) turned counterclockwise about a unit axis (3,) (Rodrigues' formula)."""
    cos, sin = cosine_sine(degrees)
    turned: NDArray = vector * cos + np.cross(axis, vector) * sin + axis * (axis @ vector) * (1 - cos)
    return turned
