"""The triangles of a mesh shape: read, cut, placed and rounded (document, section 5).

Vertices are rounded to single precision as read and once more after they were placed, so that every
precision, every backend and Mitsuba see the same triangles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain
from pathlib import Path

import numpy as np

from tracer.errors import SceneError
from tracer.placement import Placement
from tracer.shapes.mesh import Mesh
from tracer.shapes.obj import read_obj
from tracer.shapes.ply import read_ply
from tracer.shapes.polygons import PolygonSoup

BUILTIN_MESHES: dict[str, tuple[list[tuple[int, int, int]], list[tuple[int, ...]]]] = {
    "cube": (
        [(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)],
        [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)],
    ),
    "tetrahedron": (
        [(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)],
        [(1, 3, 2), (0, 2, 3), (0, 3, 1), (0, 1, 2)],
    ),
}
"""Wound outward. Faces of the cube: -x, +x, -y, +y, -z, +z; face k of the tetrahedron is opposite to corner
k."""


@dataclass(frozen=True)
class MeshData:
    """A mesh before it is placed.

    `vertices` (n, 3) float32 values in float64; `triangles` (m, 3) vertex numbers; `faces` (m,) number of
    the face in the file that each triangle was cut from; `normals` (m, 3, 3) at the corners, of any length,
    from the file, or (0, 3, 3) unless it has one for every corner of every face.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    faces: np.ndarray
    normals: np.ndarray


@dataclass(frozen=True)
class PlacedMesh:
    """Triangles in world space. `corners` (m, 3, 3), unit `normals` (m, 3; zero: degenerate), `faces` (m,),
    unit `corner_normals` (m, 3, 3) for smooth shading."""

    corners: np.ndarray
    normals: np.ndarray
    faces: np.ndarray
    corner_normals: np.ndarray


def read_mesh(mesh: Mesh, path: Path | None, where: str) -> MeshData:
    """The mesh that a record asks for; `path` is its resolved file, `where` names the shape in error
    texts."""
    if mesh.builtin is not None:
        vertices, faces = BUILTIN_MESHES[mesh.builtin]
        return _cut(np.array(vertices, np.float64), faces)
    if path is None:
        assert mesh.vertices is not None and mesh.faces is not None
        data = _cut(np.array(mesh.vertices, np.float64), mesh.faces)
    else:
        soup = read_ply(path) if path.suffix.lower() == ".ply" else read_obj(path)
        data = _cut(soup.vertices, soup.faces, soup)
    if len(data.triangles) == 0:
        raise SceneError(f"{where}.file: {path} has no faces; allowed: a mesh with one triangle at least")
    if not np.isfinite(data.vertices).all():
        raise SceneError(f"{where}: a vertex is not finite or leaves the range of single precision")
    return data


def place_mesh(data: MeshData, placement: Placement) -> PlacedMesh:
    """The mesh in world space, rounded to single precision; infinite where it leaves that range."""
    with np.errstate(over="ignore", invalid="ignore"):
        vertices = placement.points(data.vertices).astype(np.float32).astype(np.float64)
        corners = vertices[data.triangles]
        areas = accurate_areas(corners)
    if len(data.normals):
        # Unit length first: a length from the file times a scale could leave the range of double precision.
        corner_normals = placement.normals(_unit(data.normals).reshape(-1, 3)).reshape(-1, 3, 3)
    else:
        corner_normals = _area_weighted(data.triangles, areas, len(vertices))
    return PlacedMesh(corners, _unit(areas), data.faces, _unit(corner_normals))


def accurate_areas(corners: np.ndarray) -> np.ndarray:
    """(b - a) x (c - a) of triangles (m, 3, 3) whose corners are single precision numbers; (m, 3).

    The largest component is right to 2 ulp, and zero only for degenerate triangles: slivers lose nothing to
    cancellation. Each factor is a sum of two doubles (Dekker, A Floating-Point Technique for Extending the
    Available Precision, 1971); the few triangles for which that is too little are computed with fractions.
    Products of single precision numbers neither vanish nor overflow in double precision.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    (u, u_low), (v, v_low) = _exact_sum(b, -a), _exact_sum(c, -a)
    inexact = (u_low != 0).any(axis=1) | (v_low != 0).any(axis=1)
    areas, sizes = np.empty_like(a), np.empty_like(a)
    for axis in range(3):
        y, z = (axis + 1) % 3, (axis + 2) % 3
        p, p_low = _product(u[:, y], u_low[:, y], v[:, z], v_low[:, z])
        q, q_low = _product(u[:, z], u_low[:, z], v[:, y], v_low[:, y])
        difference, low = _exact_sum(p, -q)
        areas[:, axis] = difference + (low + (p_low - q_low))
        sizes[:, axis] = np.where(inexact | (p_low != 0) | (q_low != 0), np.abs(p) + np.abs(q), 0)
    # But for the last rounding a component is wrong by 2^-102 (|p| + |q|) at most: is that below one ulp?
    hard = 2.0**-102 * sizes.max(axis=1) > 2.0**-53 * np.abs(areas).max(axis=1)
    for number in np.flatnonzero(hard & np.isfinite(sizes).all(axis=1)):
        areas[number] = _area_by_fractions(corners[number])
    return areas


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


def _area_weighted(triangles: np.ndarray, areas: np.ndarray, vertices: int) -> np.ndarray:
    """(m, 3, 3): at each corner the sum of the areas of all triangles that name its vertex."""
    sums = np.zeros((vertices, 3))
    for corner in range(3):
        np.add.at(sums, triangles[:, corner], areas)
    return sums[triangles]


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors along the last axis; zero stays zero. Scaled first, by a power of two: squares must
    neither vanish nor overflow."""
    exponents = np.frexp(np.abs(vectors).max(axis=-1, keepdims=True))[1]
    scaled = np.ldexp(vectors, -exponents)
    length = np.linalg.norm(scaled, axis=-1, keepdims=True)
    return scaled / np.where(length > 0, length, 1)


def _cut(vertices: np.ndarray, faces: Sequence[Sequence[int]], soup: PolygonSoup | None = None) -> MeshData:
    """Cuts faces into fans of triangles, in order, and rounds the vertices to single precision."""
    sizes = np.fromiter(map(len, faces), np.int64, len(faces))
    fans = sizes - 2  # triangles of each face
    numbers = np.repeat(np.arange(len(faces)), fans)
    first = np.repeat(np.cumsum(sizes) - sizes, fans)  # place of the face's first corner among all corners
    step = np.arange(len(numbers)) - np.repeat(np.cumsum(fans) - fans, fans)
    places = np.stack([first, first + step + 1, first + step + 2], axis=1)
    triangles = _flat(faces)[places]
    corner_normals = np.zeros((0, 3, 3))
    if soup is not None and soup.has_all_normals:
        corner_normals = soup.normals[_flat(soup.face_normals)[places]]
    with np.errstate(over="ignore"):
        rounded = vertices.astype(np.float32).astype(np.float64)
    return MeshData(rounded, triangles, numbers, corner_normals)


def _flat(lists: Sequence[Sequence[int]]) -> np.ndarray:
    return np.fromiter(chain.from_iterable(lists), np.int64)
