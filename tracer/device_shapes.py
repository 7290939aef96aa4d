"""The shapes of a scene in Dr.Jit memory: what stands in the kernel, and the rows of the tables by shape."""

from __future__ import annotations

from typing import Any

import numpy as np

from tracer.backends import Backend
from tracer.device_meshes import inherited
from tracer.material import Material
from tracer.ray import SIDE_BITS
from tracer.scene import Scene
from tracer.shapes import Plane, ShapeRecord, Sphere
from tracer.shapes.sphere_table import SphereRows, SphereTable
from tracer.shapes.triangles import PlacedMesh
from tracer.textures.tables import PackedTexture

PLANE, SPHERE, MESH = range(3)

KIND_UNIT = 256
"""The kind of a shape stands above the texture flags in one word."""

UNROLLED_SPHERES = 32
"""Up to so many spheres stand in the kernel one by one; over more there is a hierarchy."""


def kind_of(shape: ShapeRecord) -> int:
    """The number of a shape's kind; instances are meshes."""
    return PLANE if isinstance(shape, Plane) else SPHERE if isinstance(shape, Sphere) else MESH


def analytic_shapes(
    scene: Scene, backend: Backend, rows: np.ndarray, first: np.ndarray
) -> tuple[list[Any], SphereRows | None, SphereTable | None, np.ndarray]:
    """Planes and spheres for the kernel, and the rows (n, d) of the planes that have bits."""
    spheres = [i for i, shape in enumerate(scene.shapes) if isinstance(shape, Sphere)]
    many = len(spheres) > UNROLLED_SPHERES
    planes: list[int] = []
    slots: list[Any] = []
    for i, shape in enumerate(scene.shapes):
        if isinstance(shape, Plane) or (isinstance(shape, Sphere) and not many):
            slots.append(shape.slot(backend, rows[i], int(first[i]), len(planes)))
        if isinstance(shape, Plane):
            planes.append(i)
    table = SphereTable.of(backend, rows[spheres], first[spheres]) if many else None
    few = SphereRows.of(backend, rows[spheres], first[spheres]) if spheres and not many else None
    return slots, few, table, rows[planes[:SIDE_BITS]]


def geometry_rows(scene: Scene) -> np.ndarray:
    """(shapes, 4): n, d of a plane, center and radius of a sphere, zero for meshes; at least one row."""
    rows = np.zeros((max(1, len(scene.shapes)), 4))
    for i, shape in enumerate(scene.shapes):
        if isinstance(shape, (Plane, Sphere)):
            rows[i] = shape.placed_coefficients()
    return rows


def id_rows(scene: Scene, textures: list[PackedTexture]) -> np.ndarray:
    """(shapes, 4) whole numbers: kind and texture flags, first color, count of colors, plane bit; at least
    one row."""
    rows = np.zeros((max(1, len(scene.shapes)), 4), np.int64)
    planes = 0
    for i, (shape, texture) in enumerate(zip(scene.shapes, textures, strict=True)):
        bit = 0
        if isinstance(shape, Plane):
            bit = 1 << planes if planes < SIDE_BITS else 0
            planes += 1
        rows[i] = kind_of(shape) * KIND_UNIT + texture.flags, texture.first, texture.count, bit
    return rows


def surface_rows(scene: Scene, textures: list[PackedTexture]) -> np.ndarray:
    """(shapes, 8): ior, k_r, k_t, k_a, m, h, s, texture rate; at least one row."""
    rows = np.zeros((max(1, len(scene.shapes)), 8))
    for i, (shape, texture) in enumerate(zip(scene.shapes, textures, strict=True)):
        name = inherited(scene, shape, "material")
        m = Material() if name is None else scene.materials[name]
        rows[i, :4] = m.ior, m.reflection, m.refraction, m.absorption
        rows[i, 4:] = m.diffuse, m.specular, m.shininess, texture.rate
    return rows


def object_space(scene: Scene, backend: Backend) -> Any:
    """The 3x4 matrices back to object space, or None when no shape asks for them."""
    wanted = [inherited(scene, shape, "texture_space") == "object" for shape in scene.shapes]
    if not any(wanted):
        return None
    rows = np.tile(np.eye(3, 4), (len(wanted), 1, 1))
    for i, shape in enumerate(scene.shapes):
        if wanted[i]:
            rows[i] = shape.placement.inverse()
    return backend.table(rows)


def extent_of(scene: Scene, rows: np.ndarray, meshes: dict[int, PlacedMesh]) -> float:
    """S: the largest |coordinate| of the finite shapes (spheres and meshes), 0 without any."""
    largest = [float(np.abs(mesh.corners).max()) for mesh in meshes.values()]
    spheres = rows[[i for i, shape in enumerate(scene.shapes) if isinstance(shape, Sphere)]]
    return max([*largest, *(np.abs(spheres[:, :3]).max(axis=1) + spheres[:, 3])], default=0.0)
