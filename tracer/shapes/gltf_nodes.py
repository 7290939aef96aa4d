"""Where the nodes of a glTF file stand: matrices in double precision, written out term by term.

No library multiplies them, so that the same file gives the same bits on every machine.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tracer.messages import show

Matrix = list[list[float]]
"""Three rows of four: a linear map and a translation."""

IDENTITY: Matrix = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]


def node_matrix(node: dict[str, Any], what: str) -> Matrix:
    """The matrix of a node, or translation times rotation times scale."""
    if "matrix" in node:
        m = _floats(node, "matrix", [], 16, what)
        return [[m[row + 4 * column] for column in range(4)] for row in range(3)]
    move = _floats(node, "translation", [0.0, 0.0, 0.0], 3, what)
    x, y, z, w = _floats(node, "rotation", [0.0, 0.0, 0.0, 1.0], 4, what)
    size = _floats(node, "scale", [1.0, 1.0, 1.0], 3, what)
    square = x * x + y * y + z * z + w * w
    if not 0 < square < math.inf:
        raise ValueError(f"`rotation` of {what} has no length")
    s = 2 / square
    turn = [
        [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
        [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
        [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
    ]
    return [[*(a * b for a, b in zip(turn[k], size, strict=True)), move[k]] for k in range(3)]


def _floats(node: dict[str, Any], key: str, default: list[float], count: int, what: str) -> list[float]:
    """So many numbers below a key."""
    found = node.get(key, default)
    if not isinstance(found, list) or len(found) != count or not all(type(x) in (int, float) for x in found):
        raise ValueError(f"`{key}` of {what} is {show(found)}; allowed: {count} numbers")
    try:
        return [float(x) for x in found]
    except OverflowError:
        raise ValueError(f"`{key}` of {what} is {show(found)}; allowed: {count} numbers") from None


def product(a: Matrix, b: Matrix) -> Matrix:
    """First b, then a."""
    below = [*b, [0.0, 0.0, 0.0, 1.0]]
    return [[sum(a[i][k] * below[k][j] for k in range(4)) for j in range(4)] for i in range(3)]


def applied(matrix: Matrix, points: np.ndarray) -> np.ndarray:
    """Points (n, 3) under a matrix; terms are added from left to right, without a library's own order."""
    x, y, z = points.astype(np.float64).T
    with np.errstate(over="ignore", invalid="ignore"):
        return np.stack([a * x + b * y + c * z + d for a, b, c, d in matrix], axis=1)


def determinant(m: Matrix) -> float:
    """Of the linear map."""
    return sum(m[0][k] * cofactor for k, cofactor in enumerate(cofactors(m, False)[0][:3]))


def cofactors(m: Matrix, mirrors: bool) -> Matrix:
    """The map of normals: the inverse transposed, times the size of the determinant."""
    sign, others = -1.0 if mirrors else 1.0, ((1, 2), (2, 0), (0, 1))
    return [[*(sign * (m[a][c] * m[b][d] - m[a][d] * m[b][c]) for c, d in others), 0.0] for a, b in others]
