"""The triangles of a mesh shape: read, cut, placed and rounded (document, section 5).

Vertices are rounded to single precision as read and once more after they were placed, so that every
precision, every backend and Mitsuba see the same triangles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
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
    the face in the file that each triangle was cut from; `normals` (m, 3, 3) at the corners, from the file,
    zero where it has none.
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
    """The mesh in world space, rounded to single precision."""
    with np.errstate(over="ignore"):
        vertices = placement.points(data.vertices).astype(np.float32).astype(np.float64)
    corners = vertices[data.triangles]
    normals = _unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    return PlacedMesh(corners, normals, data.faces, _corner_normals(data, placement, vertices))


def _corner_normals(data: MeshData, placement: Placement, vertices: np.ndarray) -> np.ndarray:
    """The file's normals where present, else the area-weighted mean of the faces around each vertex."""
    corners = vertices[data.triangles]
    weighted = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(sums, data.triangles[:, corner], weighted)
    computed = sums[data.triangles]
    if not data.normals.any():
        return _unit(computed)
    return _unit(placement.normals(data.normals.reshape(-1, 3)).reshape(-1, 3, 3))


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors along the last axis; zero stays zero. Scaled first: squares must neither vanish nor
    overflow."""
    largest = np.abs(vectors).max(axis=-1, keepdims=True)
    scaled = vectors / np.where(largest > 0, largest, 1)
    length = np.linalg.norm(scaled, axis=-1, keepdims=True)
    return scaled / np.where(length > 0, length, 1)


def _cut(vertices: np.ndarray, faces: Sequence[Sequence[int]], soup: PolygonSoup | None = None) -> MeshData:
    """Cuts faces into fans of triangles, in order, and rounds the vertices to single precision."""
    fans = [(number, k) for number, face in enumerate(faces) for k in range(1, len(face) - 1)]
    triangles = [(faces[n][0], faces[n][k], faces[n][k + 1]) for n, k in fans]
    corner_normals = np.zeros((len(triangles), 3, 3))
    if soup is not None and soup.has_all_normals:
        ids = [[soup.face_normals[n][corner] for corner in (0, k, k + 1)] for n, k in fans]
        corner_normals = soup.normals[np.array(ids).reshape(-1, 3)]
    with np.errstate(over="ignore"):
        rounded = vertices.astype(np.float32).astype(np.float64)
    numbers = np.array([number for number, _ in fans], np.int64)
    return MeshData(rounded, np.array(triangles, np.int64).reshape(-1, 3), numbers, corner_normals)
