"""Writes teapot.obj from the npm package `teapot`: its bicubic patches once more, in finer triangles.

The package holds 32 patches as triangles, five by five points each. A bicubic patch has four by four control
points, so that these follow from the points by least squares; what is left over is the package's rounding.
After `npm pack teapot` and unpacking, run `python assets/make_teapot.py package/teapot.js [FOLDER]`; without
a folder it writes into this one.
"""

from __future__ import annotations

import json
import re
import sys
from itertools import product
from pathlib import Path

import numpy as np

DIVISIONS = 8  # of a patch's edge; four patches go around the pot
SCALE, SHIFT = 5.0, (1.0703125, 7.875, 0.0)  # package = SCALE * Newell's units - SHIFT, y up in both
DECIMALS = 5  # of Newell's control points
ROUNDING = 2e-6  # the package has six decimals
MISPRINT, MENDED = (1, 1, 0, 0), -0.784  # patch, row, column, axis: -0.874 there, unlike in its mirror images

GRID = [(0, 0), (1, 0), (1, 1), (0, 1), (1, 2), (0, 2), (1, 3), (0, 3), (1, 4), (0, 4)]
GRID += [(row, column) for row in (2, 3, 4) for column in range(5)]
BOTTOM = [place for place in GRID if place != (0, 4)]  # column 4 is one point, stored once less
KNOB = [(1, 1), (0, 1), (0, 0), (1, 2), (0, 2), (1, 3), (0, 3), (1, 4), (0, 4)]  # here column 0 is
KNOB += [(row, column) for row in (2, 3, 4) for column in (1, 0, 2, 3, 4)]


def bernstein(t: np.ndarray) -> np.ndarray:
    """(n, 4): the cubic Bernstein polynomials at t (n,)."""
    s = 1 - t
    return np.stack([s**3, 3 * t * s**2, 3 * t**2 * s, t**3], axis=1)


def bernstein_slope(t: np.ndarray) -> np.ndarray:
    """(n, 4): their derivatives."""
    s = 1 - t
    return np.stack([-3 * s**2, 3 * s**2 - 6 * t * s, 6 * t * s - 3 * t**2, 3 * t**2], axis=1)


def read_patches(package: Path) -> list[np.ndarray]:
    """The points of every patch (5, 5, 3), as the package has them."""
    tables = dict(
        re.findall(r"exports\.(\w+)\s*=\s*(\[.*?\]);", package.read_text(encoding="utf-8"), re.DOTALL)
    )
    positions, cells = (np.array(json.loads(tables[key])) for key in ("positions", "cells"))
    last = np.maximum.accumulate(cells.max(axis=1))
    starts = [
        0,
        *(int(cell.min()) for cell, before in zip(cells[1:], last, strict=False) if cell.min() > before),
    ]
    return [grid_of(points) for points in np.split(positions, starts[1:])]


def grid_of(points: np.ndarray) -> np.ndarray:
    """The points of a patch, which stand in the order of their first triangle, as rows and columns."""
    is_knob = len(points) < len(GRID) and points[0, 1] > 0
    places = GRID if len(points) == len(GRID) else KNOB if is_knob else BOTTOM
    grid = np.empty((5, 5, 3))
    for place, point in zip(places, points, strict=True):
        grid[place] = point
    if len(points) < len(GRID):
        pole = 0 if is_knob else 4
        grid[:, pole] = grid[2, pole]
    return grid


def control_points(grid: np.ndarray) -> np.ndarray:
    """The control points (4, 4, 3) in Newell's units; fails where the points lie on no bicubic patch."""
    basis = bernstein(np.linspace(0, 1, 5))
    inverse = np.linalg.pinv(basis)
    found = np.einsum("ai,bj,ijk->abk", inverse, inverse, grid)
    assert np.abs(np.einsum("ia,jb,abk->ijk", basis, basis, found) - grid).max() < ROUNDING
    newell = (found + SHIFT) / SCALE
    assert np.abs(newell - newell.round(DECIMALS)).max() < ROUNDING
    return newell.round(DECIMALS)


def sample(control: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points and outward unit normals (n + 1, n + 1, 3) of a patch; at a pole the normal is vertical."""
    t = np.linspace(0, 1, DIVISIONS + 1)
    value, slope = bernstein(t), bernstein_slope(t)
    points = np.einsum("ia,jb,abk->ijk", value, value, control)
    normals = np.cross(
        np.einsum("ia,jb,abk->ijk", slope, value, control), np.einsum("ia,jb,abk->ijk", value, slope, control)
    )
    length = np.linalg.norm(normals, axis=2, keepdims=True)
    vertical = np.stack([0 * points[..., 1], np.where(points[..., 1] > 1, 1.0, -1.0), 0 * points[..., 1]], 2)
    return points, np.where(length > 1e-9, normals / np.maximum(length, 1e-9), vertical)


class Numbers:
    """The lines of one kind, each with its number; equal ones share it."""

    def __init__(self, keyword: str, decimals: int) -> None:
        self.lines: dict[str, int] = {}
        self._keyword, self._decimals = keyword, decimals

    def __call__(self, vector: np.ndarray) -> int:
        rounded = [f"{c + 0.0:g}" for c in np.round(vector, self._decimals) + 0.0]
        return self.lines.setdefault(f"{self._keyword} {' '.join(rounded)}", len(self.lines) + 1)


def obj(patches: list[np.ndarray]) -> str:
    """The OBJ file; patches share the points of their seams, and the normals where no crease is."""
    point_of, normal_of, faces = Numbers("v", 5), Numbers("vn", 4), []
    for control in patches:
        points, normals = sample(control)
        corner = {place: (point_of(points[place]), normal_of(normals[place])) for place in np.ndindex(9, 9)}
        for row, column in product(range(DIVISIONS), repeat=2):
            a, b, c, d = (corner[row + i, column + j] for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
            for triangle in ((a, b, c), (c, d, a)):
                if len({number for number, _ in triangle}) == 3:
                    faces.append("f " + " ".join(f"{point}//{normal}" for point, normal in triangle))
    what = f"32 bicubic patches in {len(faces):,} triangles"
    head = f"# The Utah teapot, {what}; see README.md for origin and terms."
    return "\n".join([head, *point_of.lines, *normal_of.lines, *faces, ""])


def main(package: Path, folder: Path) -> None:
    """Writes teapot.obj into the folder."""
    patches = [control_points(grid) for grid in read_patches(package)]
    *place, axis = MISPRINT
    patches[place[0]][place[1], place[2], axis] = MENDED
    (folder / "teapot.obj").write_text(obj(patches), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else Path(__file__).resolve().parent)
