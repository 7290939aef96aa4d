"""The triangles of a mesh shape: read, cut, placed and rounded (document, section 5).

Vertices are rounded to single precision as read and once more after they were placed, so that every
precision, every backend and Mitsuba see the same triangles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain
from pathlib import Path

import numpy as np

from tracer.cache import Cache, FileCache, Identity
from tracer.errors import SceneError
from tracer.placement import Placement
from tracer.shapes.areas import accurate_areas
from tracer.shapes.cutting import cut_polygons
from tracer.shapes.mesh import Mesh
from tracer.shapes.mesh_files import read_polygons
from tracer.shapes.polygons import PolygonSoup
from tracer.shapes.repetitions import repeated

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


@dataclass(frozen=True, eq=False)
class MeshData:
    """A mesh before it is placed.

    `vertices` (n, 3) float32 values in float64; `triangles` (m, 3) vertex numbers; `faces` (m,) number of
    the face in the file that each triangle was cut from; `normals` (m, 3, 3) at the corners, of any length,
    from the file, or (0, 3, 3) unless it has one for every corner of every face; `places` (n,), where the
    file does not number its vertices: the first vertex at the place of each; `files`: all that were read.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    faces: np.ndarray
    normals: np.ndarray
    places: np.ndarray | None = None
    files: tuple[Path, ...] = ()


_FILES: FileCache[MeshData] = FileCache(entries=32, megabytes=256)
_LISTS: Cache[MeshData] = Cache(entries=32, megabytes=64)
"""By the tuples of vertices and faces, which are parts of a record."""


@dataclass(frozen=True, eq=False)
class PlacedMesh:
    """Triangles of `data` in world space. `corners` (m, 3, 3), unit `normals` (m, 3; zero: degenerate),
    `repeated` (m,): whether one before has the same corners."""

    data: MeshData
    placement: Placement
    corners: np.ndarray
    normals: np.ndarray
    repeated: np.ndarray

    @property
    def faces(self) -> np.ndarray:
        """(m,) number of the face in the file that each triangle was cut from."""
        return self.data.faces

    @property
    def corner_normals(self) -> np.ndarray:
        """(m, 3, 3) unit normals for smooth shading: the file's, else area-weighted ones."""
        data = self.data
        if len(data.normals):
            # Unit length first: a length from the file times a scale could leave the range of double
            # precision.
            normals = self.placement.normals(_unit(data.normals).reshape(-1, 3))
            return _unit(normals.reshape(-1, 3, 3))
        triangles = data.triangles if data.places is None else data.places[data.triangles]
        areas = accurate_areas(self.corners)
        return _unit(_area_weighted(triangles, areas, len(data.vertices)))[triangles]

    @property
    def degenerate(self) -> np.ndarray:
        """(m,) whether a triangle has no area."""
        return np.asarray((self.normals == 0).all(axis=1))

    @property
    def in_hierarchy(self) -> np.ndarray:
        """(m,) whether a triangle can be hit at all; where none can, the first stands for the mesh."""
        wanted = ~(self.repeated | self.degenerate)
        wanted[0] |= not wanted.any()
        return wanted


def read_mesh(mesh: Mesh, path: Path | None, where: str) -> MeshData:
    """The mesh that a record asks for; `path` is its resolved file, `where` names the shape in error texts.
    Read anew only where the file or the lists have changed."""
    if mesh.builtin is not None:
        return _builtin(mesh.builtin)
    if path is None:
        vertices, faces = mesh.vertices, mesh.faces
        assert vertices is not None and faces is not None
        key = Identity(vertices), Identity(faces)
        return _LISTS.get(key, lambda: _triangles(_plain_soup(vertices, faces), where))
    return _FILES.get(path, lambda path: _read_file(path, where))


@cache
def _builtin(name: str) -> MeshData:
    vertices, faces = BUILTIN_MESHES[name]
    return _triangles(_plain_soup(vertices, faces), name)


def _read_file(path: Path, where: str) -> tuple[MeshData, tuple[Path, ...]]:
    soup = read_polygons(path)
    if len(soup.sizes) == 0:
        raise SceneError(f"{where}.file: {path} has no faces; allowed: a mesh with one triangle at least")
    data = replace(_triangles(soup, str(path)), files=(path, *soup.other_files))
    return data, soup.other_files


def place_mesh(data: MeshData, placement: Placement) -> PlacedMesh:
    """The mesh in world space, rounded to single precision; infinite where it leaves that range."""
    with np.errstate(over="ignore", invalid="ignore"):
        vertices = placement.points(data.vertices).astype(np.float32).astype(np.float64)
        corners = np.take(vertices, data.triangles, axis=0)  # three times as quick as by an index
        areas = accurate_areas(corners)
    return PlacedMesh(data, placement, corners, _unit(areas), repeated(corners))


def _area_weighted(triangles: np.ndarray, areas: np.ndarray, vertices: int) -> np.ndarray:
    """(n, 3): for each vertex the sum of the areas of all triangles that name it."""
    sums = np.zeros((vertices, 3))
    for corner in range(3):
        np.add.at(sums, triangles[:, corner], areas)
    return sums


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors along the last axis; zero stays zero. Scaled first, by a power of two: squares must
    neither vanish nor overflow."""
    x, y, z = (np.abs(vectors[..., k, None]) for k in range(3))  # much faster than along an axis of three
    scaled = np.ldexp(vectors, -np.frexp(np.maximum(np.maximum(x, y), z))[1])
    x, y, z = (scaled[..., k, None] for k in range(3))
    length = np.sqrt(x * x + y * y + z * z)
    return scaled / np.where(length > 0, length, 1)


def _plain_soup(vertices: Sequence[Sequence[float]], faces: Sequence[Sequence[int]]) -> PolygonSoup:
    sizes = np.fromiter(map(len, faces), np.int64, len(faces))
    corners = np.fromiter(chain.from_iterable(faces), np.int64)
    return PolygonSoup(np.array(vertices, np.float64), np.zeros((0, 3)), corners, sizes)


def _triangles(soup: PolygonSoup, where: str) -> MeshData:
    """Rounds the vertices to single precision and cuts the faces into triangles, in order."""
    with np.errstate(over="ignore"):
        vertices = soup.vertices.astype(np.float32).astype(np.float64)
    if not np.isfinite(vertices).all():
        raise SceneError(f"{where}: a vertex is not finite or leaves the range of single precision")
    try:
        places = cut_polygons(vertices, soup.corners, soup.sizes)
    except ValueError as error:
        raise SceneError(f"{where}: {error}") from None
    normals = soup.normals[soup.corner_normals[places]] if soup.has_all_normals else np.zeros((0, 3, 3))
    numbers = np.repeat(np.arange(len(soup.sizes)), soup.sizes - 2)
    return MeshData(vertices, soup.corners[places], numbers, normals, soup.places)
