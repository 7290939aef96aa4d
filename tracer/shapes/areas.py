"""Areas of triangles without cancellation, so that slivers of every size get the right normal."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

BLOCK = 4096
"""Triangles at a time: what is computed of them stays near the processor."""


def accurate_areas(corners: np.ndarray) -> np.ndarray:
    """(b - a) x (c - a) of triangles (m, 3, 3) whose corners are single precision numbers; (m, 3).

    The largest component is right to 2 ulp, and zero only for degenerate triangles: slivers lose nothing to
    cancellation. Each factor is a sum of two doubles (Dekker, A Floating-Point Technique for Extending the
    Available Precision, 1971); the few triangles for which that is too little are computed with fractions.
    Products of single precision numbers neither vanish nor overflow in double precision.
    """
    areas = np.empty((len(corners), 3))
    for begin in range(0, len(corners), BLOCK):
        block = corners[begin : begin + BLOCK]
        areas[begin : begin + BLOCK], hard = _areas(np.ascontiguousarray(block.transpose(1, 2, 0)))
        for number in begin + np.flatnonzero(hard):
            areas[number] = _area_by_fractions(corners[number])
    return areas


def _areas(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The areas (m, 3) of triangles with `corners` (3, 3, m), corners first, and whether two doubles were too
    little for one (m,)."""
    a, b, c = corners
    (u, u_low), (v, v_low) = _exact_sum(b, -a), _exact_sum(c, -a)
    inexact = (u_low != 0).any(axis=0) | (v_low != 0).any(axis=0)
    areas, sizes = np.empty_like(a), np.empty_like(a)
    for axis in range(3):
        y, z = (axis + 1) % 3, (axis + 2) % 3
        p, p_low = _product(u[y], u_low[y], v[z], v_low[z])
        q, q_low = _product(u[z], u_low[z], v[y], v_low[y])
        difference, low = _exact_sum(p, -q)
        areas[axis] = difference + (low + (p_low - q_low))
        sizes[axis] = np.where(inexact | (p_low != 0) | (q_low != 0), np.abs(p) + np.abs(q), 0)
    # But for the last rounding a component is wrong by 2^-102 (|p| + |q|) at most: is that below one ulp?
    hard = 2.0**-102 * sizes.max(axis=0) > 2.0**-53 * np.abs(areas).max(axis=0)
    return areas.T, hard & np.isfinite(sizes).all(axis=0)


def _exact_sum(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """x + y as the rounded sum and its rounding error (Knuth)."""
    total = x + y
    part = total - x
    return total, (x - (total - part)) + (y - part)


def _product(
    x: np.ndarray, x_low: np.ndarray, y: np.ndarray, y_low: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(x + x_low)(y + y_low) as a sum of two doubles, but for x_low y_low and roundings of that size."""
    product = x * y
    x1, y1 = _upper_half(x), _upper_half(y)
    x2, y2 = x - x1, y - y1
    error = x2 * y2 - (((product - x1 * y1) - x2 * y1) - x1 * y2)
    return product, error + (x * y_low + x_low * y)


def _upper_half(x: np.ndarray) -> np.ndarray:
    """x rounded to 26 bits, so that products of halves are exact (Veltkamp)."""
    scaled = x * (2.0**27 + 1)
    return scaled - (scaled - x)


def _area_by_fractions(corners: np.ndarray) -> list[float]:
    a, b, c = ([Fraction(float(x)) for x in corner] for corner in corners)
    u, v = ([x - y for x, y in zip(end, a, strict=True)] for end in (b, c))
    return [float(u[i - 2] * v[i - 1] - u[i - 1] * v[i - 2]) for i in range(3)]
