"""The meshes of a scene in Dr.Jit memory: triangles, hierarchy, vertex normals, and balls around them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tracer.acceleration.build import build_hierarchy
from tracer.acceleration.layout import threaded
from tracer.acceleration.triangle import CONTACT_SLACK, TRIANGLE_WORDS, TriangleTables
from tracer.backends import INVALID, Backend
from tracer.cache import Cache
from tracer.errors import SceneError
from tracer.placement import Placement
from tracer.scene import Scene
from tracer.shafts import Ball, Enclosure, ball_around
from tracer.shapes import Instance, Mesh, ShapeRecord
from tracer.shapes.triangles import MeshData, PlacedMesh, place_mesh, read_mesh

SINGLE_ENCLOSURES = 8
"""Up to so many meshes have a ball of their own around them; more share one."""

LARGEST_CONVEX = 128
"""Triangles of a mesh that is tested for being convex, at most."""


@dataclass
class SmoothTables:
    """Unit vertex normals in rows like those of the triangles, and which shapes want them."""

    normals: Any
    shapes: Any


@dataclass
class MeshTables:
    """All meshes of a scene: `triangles` with the hierarchy over them, `enclosures`: balls around meshes,
    `smooth`: vertex normals where a shape wants them, and by primitive `shape_of` and `slot_of`, its triangle
    in the hierarchy. Without meshes everything is None."""

    triangles: TriangleTables | None = None
    enclosures: list[Enclosure] = field(default_factory=list)
    smooth: SmoothTables | None = None
    shape_of: Any = None
    slot_of: Any = None


_PLACED: Cache[PlacedMesh] = Cache(entries=1024, megabytes=256)
_TABLES: Cache[MeshTables] = Cache(entries=4, megabytes=512)


def compile_meshes(
    scene: Scene, backend: Backend, meshes: dict[int, PlacedMesh], first: np.ndarray
) -> MeshTables:
    """The tables of placed meshes by shape; `first` (shapes + 1,): the first primitive of each shape."""
    if not meshes:
        return MeshTables()
    smooth = [i in meshes and bool(inherited(scene, shape, "smooth")) for i, shape in enumerate(scene.shapes)]

    def make() -> MeshTables:
        counts = np.diff(first)
        triangles, slots = _triangle_tables(backend, meshes, first)
        return MeshTables(
            triangles=triangles,
            enclosures=_enclosures(backend, meshes),
            smooth=_smooth_tables(backend, meshes, slots, smooth),
            shape_of=backend.id_table(np.repeat(np.arange(len(counts)), counts)),
            slot_of=backend.id_table(_slot_of_primitive(counts, meshes, slots)),
        )

    return _TABLES.get((backend, *meshes.items(), *first.tolist(), *smooth), make)


def source_of(scene: Scene, shape: ShapeRecord) -> ShapeRecord:
    """The mesh that an instance shares; every other shape itself."""
    if not isinstance(shape, Instance):
        return shape
    return next(other for other in scene.shapes if other.name == shape.of)


def inherited(scene: Scene, shape: ShapeRecord, key: str) -> Any:
    """A key of a shape, or of the mesh that it shares where it has none of its own."""
    own = getattr(shape, key)
    return getattr(source_of(scene, shape), key) if own is None else own


def placed_meshes(scene: Scene) -> dict[int, PlacedMesh]:
    """Triangles of every mesh and instance, by shape; each file is read once."""
    read: dict[int, MeshData] = {}
    placed: dict[int, PlacedMesh] = {}
    for i, shape in enumerate(scene.shapes):
        mesh = source_of(scene, shape)
        if not isinstance(mesh, Mesh):
            continue
        if id(mesh) not in read:
            path = None if mesh.file is None else scene.resolve(mesh.file)
            read[id(mesh)] = read_mesh(mesh, path, f"{scene.name}: shapes.{mesh.name or i}")
        placed[i] = _placed(read[id(mesh)], shape.placement, f"{scene.name}: shapes.{shape.name or i}")
    return placed


def _placed(data: MeshData, placement: Placement, where: str) -> PlacedMesh:
    """The mesh in world space, placed only once; `where` names the shape in error texts."""

    def make() -> PlacedMesh:
        placed = place_mesh(data, placement)
        if not np.isfinite(placed.corners).all():
            raise SceneError(f"{where} leaves the range of single precision")
        return placed

    numbers = placement.rotation, placement.scale, placement.shift
    return _PLACED.get((data, placement.is_identity, *(x.tobytes() for x in numbers)), make)


def _triangle_tables(
    backend: Backend, meshes: dict[int, PlacedMesh], first: np.ndarray
) -> tuple[TriangleTables, np.ndarray]:
    """The triangles of all meshes in the order of the leaves, the tree over them, and the slot of each: -1
    for those that are left out, because they have no area or repeat one of their mesh."""
    wanted = np.flatnonzero(np.concatenate([mesh.in_hierarchy for mesh in meshes.values()]))
    corners = np.take(np.concatenate([mesh.corners for mesh in meshes.values()]), wanted, axis=0)
    hierarchy = build_hierarchy(backend, corners)
    order = wanted[hierarchy.order]
    rows = np.zeros((len(order), TRIANGLE_WORDS), backend.dtype)
    rows[:, :9] = np.take(corners.reshape(-1, 9), hierarchy.order, axis=0)
    rows[:, 9:12] = np.take(np.concatenate([mesh.normals for mesh in meshes.values()]), order, axis=0)
    primitives = np.concatenate([np.arange(len(mesh.corners)) + first[i] for i, mesh in meshes.items()])
    primitives = primitives[order]
    rows[:, 12], rows[:, 13] = primitives >> 16, primitives & 0xFFFF
    edges = _longest_edges(corners)
    rows[:, 14] = edges[hierarchy.order]
    box = np.stack([hierarchy.lower[0], hierarchy.upper[0]]).astype(np.float64)
    tables = TriangleTables(backend.table(rows), threaded(backend, hierarchy), box, float(np.median(edges)))
    slots = np.full(sum(len(mesh.corners) for mesh in meshes.values()), -1)
    slots[order] = np.arange(len(order))
    return tables, slots


def _longest_edges(corners: np.ndarray) -> np.ndarray:
    """(n,) from corners (n, 3, 3)."""
    longest = np.zeros(len(corners))
    for k in range(3):
        x, y, z = (corners[:, k] - corners[:, k - 1]).T
        np.maximum(longest, x * x + y * y + z * z, out=longest)
    return np.sqrt(longest)


def _enclosures(backend: Backend, meshes: dict[int, PlacedMesh]) -> list[Enclosure]:
    """A ball around each mesh, or one around all of many."""

    def around(points: np.ndarray, shape: int, convex: bool) -> Enclosure:
        return Enclosure(
            Ball.of(backend, ball_around(points, backend.epsilon)), backend.opaque_id(shape), convex
        )

    if len(meshes) > SINGLE_ENCLOSURES:
        return [around(np.concatenate([m.corners.reshape(-1, 3) for m in meshes.values()]), INVALID, False)]
    return [
        around(mesh.corners.reshape(-1, 3), shape, is_convex(mesh, backend.epsilon))
        for shape, mesh in meshes.items()
    ]


def is_convex(mesh: PlacedMesh, epsilon: float) -> bool:
    """Whether no triangle rises above another by more than the rounding of its own coordinates, which shadow
    rays do not notice (`CONTACT_SLACK`); large meshes are not looked at."""
    if len(mesh.corners) > LARGEST_CONVEX:
        return False
    corners, normals = mesh.corners[mesh.in_hierarchy], mesh.normals[mesh.in_hierarchy]
    n = len(corners)
    planes = (normals * corners[:, 0]).sum(axis=1)
    rises = (normals @ corners.reshape(-1, 3).T - planes[:, None]).reshape(n, n, 3).max(axis=2)
    reach = np.abs(corners).max(axis=(1, 2))
    return bool((rises <= CONTACT_SLACK / 4 * epsilon * reach).all())


def _slot_of_primitive(counts: np.ndarray, meshes: dict[int, PlacedMesh], slots: np.ndarray) -> np.ndarray:
    """For each primitive the slot of its triangle (0 for what is never asked for: planes, spheres, triangles
    that are left out)."""
    result = np.zeros(counts.sum(), np.int64)
    result[np.repeat([i in meshes for i in range(len(counts))], counts)] = np.maximum(slots, 0)
    return result


def _smooth_tables(
    backend: Backend, meshes: dict[int, PlacedMesh], slots: np.ndarray, wanted: list[bool]
) -> SmoothTables | None:
    if not any(wanted):
        return None
    kept = slots >= 0
    rows = np.zeros((int(kept.sum()), TRIANGLE_WORDS))
    normals = np.concatenate([mesh.corner_normals for mesh in meshes.values()]).reshape(-1, 9)
    rows[slots[kept], :9] = normals[kept]
    return SmoothTables(backend.table(rows), backend.id_table(wanted))
