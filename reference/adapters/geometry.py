"""What the adapters give: bodies and a camera in Mitsuba's terms, as plain NumPy numbers.

Both the scene in memory and the exported file are made of these, so they cannot differ.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np


@dataclass(frozen=True)
class Ball:
    """A sphere in world space: `center` (3,) and `radius`."""

    center: np.ndarray
    radius: float


@dataclass(frozen=True)
class Disk:
    """A disk in place of an infinite plane: unit `normal` n (3,) and `d` with n.p + d = 0, and its `radius`.

    The center is the point of the plane next to the origin.
    """

    normal: np.ndarray
    d: float
    radius: float

    def tangents(self) -> tuple[np.ndarray, np.ndarray]:
        """Unit vectors u, v in the plane with u x v = n."""
        helper = np.eye(3)[np.argmin(np.abs(self.normal))]
        u = np.cross(helper, self.normal)
        u /= np.linalg.norm(u)
        return u, np.cross(self.normal, u)

    def to_world(self) -> np.ndarray:
        """(4, 4): takes the unit disk across z to this one."""
        u, v = self.tangents()
        matrix = np.eye(4)
        matrix[:3] = np.stack([u * self.radius, v * self.radius, self.normal, -self.d * self.normal], axis=1)
        return matrix

    def to_object(self) -> np.ndarray:
        """(4, 4): the inverse of `to_world`, in closed form: a large radius costs no digits."""
        u, v = self.tangents()
        matrix = np.eye(4)
        matrix[:3, :3] = np.stack([u / self.radius, v / self.radius, self.normal])
        matrix[2, 3] = self.d
        return matrix


@dataclass(frozen=True)
class Triangles:
    """The triangles of a mesh that can be hit.

    `corners` (m, 3, 3) single precision numbers in world space; `numbers` (m,) their primitive numbers, which
    count the degenerate ones that are left out here; `corner_normals` (m, 3, 3) unit normals for smooth
    shading, or None for flat.
    """

    corners: np.ndarray
    numbers: np.ndarray
    corner_normals: np.ndarray | None = None


Body: TypeAlias = Ball | Disk | Triangles


@dataclass(frozen=True)
class Perspective:
    """A perspective sensor: `x` (right), `y` (down), `forward` unit vectors and `eye`, all (3,).

    `fov` across the width in degrees; `shift` of the principal point as shares of width and height; `near`,
    `far` distances along the axis; `width`, `height` in pixels; `samples` n: n x n rays a pixel, at the
    centers of its n x n parts.
    """

    eye: np.ndarray
    x: np.ndarray
    y: np.ndarray
    forward: np.ndarray
    fov: float
    shift: tuple[float, float]
    near: float
    far: float
    width: int
    height: int
    samples: int

    def to_world(self) -> np.ndarray:
        """(4, 4): Mitsuba's camera looks along +z with +x to the left and +y up in the picture."""
        matrix = np.eye(4)
        matrix[:3] = np.stack([-self.x, -self.y, self.forward, self.eye], axis=1)
        return matrix
