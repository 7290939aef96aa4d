"""On which side of an edge a line passes, without rounding: in doubles where these can tell, else in whole
numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray

PLACES = 149
"""Every number of single precision is a whole number of 2^-149."""

DOUBT = 32 * 2.0**-53
"""In doubles the sum of three products of rounded differences is wrong by less, in units of the largest."""


def edge_functions(o: Array, d: Array, corners: Array) -> Array:
    """(n, 3) d . ((b - o) x (c - o)) for the edges b to c opposite the corners of triangles (n, 3, 3), with
    their true signs; 0 is 0.

    `o`, `d` (n, 3) and corners are numbers of single precision, held as doubles.
    """
    seen = corners - o[:, None]
    values = _products(d, seen)
    largest = np.abs(d).max(axis=1) * np.abs(seen).max(axis=(1, 2)) ** 2
    unsure = np.flatnonzero((np.abs(values) <= DOUBT * largest[:, None]).any(axis=1))
    if len(unsure):
        origin, way, ends = (_whole(v[unsure]) for v in (o, d, corners))
        values[unsure] = (_products(way, ends - origin[:, None]) / 2 ** (3 * PLACES)).astype(np.float64)
    return values


def passes_through(values: Array) -> Array:
    """(n,) whether a line with these three meets the triangle or its border: no two have opposite signs."""
    return np.asarray((values >= 0).all(axis=1) | (values <= 0).all(axis=1))


def _products(d: Any, seen: Any) -> Any:
    """Triple products of d with the three pairs of corners."""
    found = []
    for b, c in ((1, 2), (2, 0), (0, 1)):
        x, y, z = (
            seen[:, b, i - 2] * seen[:, c, i - 1] - seen[:, b, i - 1] * seen[:, c, i - 2] for i in range(3)
        )
        found.append(d[:, 0] * x + d[:, 1] * y + d[:, 2] * z)
    return np.stack(found, axis=1)


def _whole(values: Array) -> Array:
    """Python's whole numbers, which have as many digits as it takes."""
    return np.asarray(np.frompyfunc(int, 1, 1)(values * 2.0**PLACES))
