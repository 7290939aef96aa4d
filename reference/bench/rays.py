"""The rays of the queries, as NumPy arrays that both sides are given: the same rays for both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

EYE, TARGET, FIELD = np.array([0.6, 0.9, 3.2]), np.zeros(3), 42.0
"""Where the unit mesh is seen from; its picture fills the view, and corners miss it."""

LIGHT = np.array([2.5, 3.0, 2.0])
NUDGE = 1e-4
"""Secondary rays start so far above the surface, which has unit size: neither side meets it again."""

KINDS = ("primary, scan order", "primary, tile order", "shadow", "mirror", "diffuse")
TILE = 8
BUNDLE = 16
"""Shadow rays come in whole bundles."""


@dataclass(frozen=True)
class Rays:
    """Origins and unit directions (n, 3), float32; shadow rays look for anything before `length` (n,)."""

    o: np.ndarray
    d: np.ndarray
    length: np.ndarray | None = None

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.o)


def primary(pixels: int, tiles: bool) -> Rays:
    """One ray a pixel of a square picture, row by row or in tiles of 8 x 8 along a Morton curve."""
    row, column = (index.ravel() for index in np.indices((pixels, pixels)))
    if tiles:
        order = np.lexsort((_morton(column % TILE, row % TILE), column // TILE, row // TILE))
        row, column = row[order], column[order]
    forward = (TARGET - EYE) / np.linalg.norm(TARGET - EYE)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    step = 2 * np.tan(np.radians(FIELD) / 2) / pixels
    x, y = (column + 0.5 - pixels / 2) * step, (row + 0.5 - pixels / 2) * step
    d = forward + x[:, None] * right + y[:, None] * down
    return _rays(np.broadcast_to(EYE, d.shape), d)


def secondary(first: Rays, t: np.ndarray, normal: np.ndarray) -> dict[str, Rays]:
    """Rays from the points that primary rays hit at t (n,), with outward normals (n, 3) there."""
    hit = np.isfinite(t)
    d = first.d[hit].astype(np.float64)
    n = normal[hit] * -np.sign((normal[hit] * d).sum(axis=1, keepdims=True))
    p = first.o[hit] + t[hit, None] * d + NUDGE * n
    to_light = LIGHT - p
    length = np.linalg.norm(to_light, axis=1)
    lit = np.flatnonzero((to_light * n).sum(axis=1) > 0)
    lit = lit[: len(lit) // BUNDLE * BUNDLE]
    rng = np.random.default_rng(7)
    around = rng.normal(size=p.shape)
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    return {
        "shadow": _rays(p[lit], to_light[lit], length[lit]),
        "mirror": _rays(p, d - 2 * (d * n).sum(axis=1, keepdims=True) * n),
        "diffuse": _rays(p, n + 0.999 * around),  # cosine-weighted
    }


def _rays(o: np.ndarray, d: np.ndarray, length: np.ndarray | None = None) -> Rays:
    d = d / np.linalg.norm(d, axis=1, keepdims=True)
    limit = None if length is None else length.astype(np.float32)
    return Rays(np.ascontiguousarray(o, np.float32), d.astype(np.float32), limit)


def _morton(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    across, down = ((v & 1) | ((v & 2) << 1) | ((v & 4) << 2) for v in (x, y))
    return across + 2 * down
