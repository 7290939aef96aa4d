"""What a mesh holds twice: triangles with the same corners, wound either way, and vertices at one place."""

from __future__ import annotations

import numpy as np

_FACTORS = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
"""Large odd numbers without a meaning, which spread bits."""

BLOCK = 8192
"""Triangles at a time: what is computed of them stays near the processor."""


def repeated(corners: np.ndarray) -> np.ndarray:
    """(m,) whether a triangle of `corners` (m, 3, 3) has the same corners as one before it.

    Triangles are sorted by a hash that does not depend on the order of the corners; only those that share
    one are compared.
    """
    result = np.zeros(len(corners), bool)
    hashes = _hashes(corners)
    in_order = np.sort(hashes)
    if not (in_order[1:] == in_order[:-1]).any():
        return result
    order = np.argsort(hashes, kind="stable")
    same = hashes[order[1:]] == hashes[order[:-1]]
    in_doubt = order[np.r_[False, same] | np.r_[same, False]]
    seen = set[tuple[tuple[float, ...], ...]]()
    for number in np.sort(in_doubt).tolist():
        key = tuple(sorted(map(tuple, corners[number].tolist())))
        result[number] = key in seen
        seen.add(key)
    return result


def first_at_place(vertices: np.ndarray) -> np.ndarray:
    """(n,) for each of `vertices` (n, 3) the first one at the same place."""
    _, first, group = np.unique(_mixed(vertices), return_index=True, return_inverse=True)
    places = first[group]
    if not np.array_equal(vertices[places], vertices):  # two places share a hash
        _, first, group = np.unique(vertices + 0.0, axis=0, return_index=True, return_inverse=True)
        places = first[group.reshape(-1)]
    return places


def _hashes(corners: np.ndarray) -> np.ndarray:
    """(m,) equal for triangles with equal corners, whatever their order."""
    hashes = np.empty(len(corners), np.uint64)
    for begin in range(0, len(corners), BLOCK):
        a, b, c = (_mixed(corners[begin : begin + BLOCK, k]) for k in range(3))
        hashes[begin : begin + BLOCK] = a * a + b * b + c * c
    return hashes


def _mixed(points: np.ndarray) -> np.ndarray:
    """(n,) a hash of points (n, 3)."""
    coordinates = np.ascontiguousarray(points.T) + 0.0  # -0.0 becomes 0.0, which it equals
    x, y, z = coordinates.view(np.uint64) * _FACTORS[:, None]
    mixed = x + y + z
    mixed = (mixed ^ (mixed >> np.uint64(29))) * _FACTORS[0]
    return np.asarray(mixed ^ (mixed >> np.uint64(32)))
