"""Displaced icospheres: rough closed meshes of any size from a seed, and as PLY files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

GOLDEN = (1 + 5**0.5) / 2
CORNERS = np.array(
    [(0, s, t * GOLDEN) for s in (-1, 1) for t in (-1, 1)]
    + [(s, t * GOLDEN, 0) for s in (-1, 1) for t in (-1, 1)]
    + [(t * GOLDEN, 0, s) for s in (-1, 1) for t in (-1, 1)]
) / np.hypot(1, GOLDEN)  # fmt: skip
OCTAVES, WAVES = 6, 4
ROUGHNESS = 0.4
"""Height of the longest waves against the radius; each octave is 0.6 times as high and half as long."""


def icosphere(frequency: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) about the unit sphere and triangles (20 frequency^2, 3), wound outward."""
    vertices, triangles = _geodesic(frequency)
    return vertices * _heights(vertices, seed)[:, None], triangles


def write_ply(path: Path, vertices: np.ndarray, triangles: np.ndarray) -> None:
    """A binary file."""
    rows = np.empty(len(triangles), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, triangles
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path.write_bytes(header.encode("ascii") + vertices.astype("<f4").tobytes() + rows.tobytes())


def _faces() -> np.ndarray:
    """(20, 3): corners of the icosahedron next to each other, wound outward."""
    near = CORNERS @ CORNERS.T > 0.4
    np.fill_diagonal(near, False)
    found = [
        (a, b, c)
        for a in range(12) for b in range(a + 1, 12) for c in range(b + 1, 12)
        if near[a, b] and near[b, c] and near[a, c]
    ]  # fmt: skip
    return np.array([f if np.linalg.det(CORNERS[list(f)]) > 0 else f[::-1] for f in found])


def _geodesic(frequency: int) -> tuple[np.ndarray, np.ndarray]:
    """Every face cut into frequency^2 triangles; a vertex is known by its weights of the twelve corners, so
    that faces share those on their common edges."""
    f = frequency
    i, j = (index.ravel() for index in np.indices((f + 1, f + 1)))
    inside = i + j <= f
    i, j = i[inside], j[inside]
    place = np.full((f + 1, f + 1), -1)
    place[i, j] = np.arange(len(i))
    up = np.array([(place[a, b], place[a + 1, b], place[a, b + 1]) for a, b in _cells(f, f - 1)])
    down = np.array([(place[a + 1, b], place[a + 1, b + 1], place[a, b + 1]) for a, b in _cells(f, f - 2)])
    cells = np.concatenate([up, down.reshape(-1, 3)])
    weights = np.zeros((20, len(i), 12), np.uint64)
    faces = _faces()
    for number, face in enumerate(faces):
        for corner, share in zip(face, (f - i - j, i, j), strict=True):
            weights[number][:, corner] = share
    rows = weights.reshape(-1, 12)
    keys = (rows * np.random.default_rng(1).integers(1, 2**63, 12, np.uint64)).sum(axis=1, dtype=np.uint64)
    first, number_of = np.unique(keys, return_index=True, return_inverse=True)[1:]
    points = rows[first].astype(np.float64) @ CORNERS
    triangles = np.concatenate([cells + face * len(i) for face in range(20)])
    return points / np.linalg.norm(points, axis=1)[:, None], number_of.reshape(-1)[triangles]


def _cells(frequency: int, most: int) -> np.ndarray:
    a, b = (index.ravel() for index in np.indices((frequency, frequency)))
    return np.column_stack([a, b])[a + b <= most]


def _heights(points: np.ndarray, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    heights = np.ones(len(points))
    for octave in range(OCTAVES):
        for _ in range(WAVES):
            axis, phase = rng.normal(size=3), rng.uniform(0, 2 * np.pi)
            wave = np.sin(3 * 2**octave * (points @ (axis / np.linalg.norm(axis))) + phase)
            heights += ROUGHNESS / WAVES * 0.6**octave * wave
    return heights
