"""Compiles a scene description into what a kernel may touch: flat tables, width-1 numbers, integer ids.

Structure (how many shapes of which kind, which options are on) is Python and part of the kernel; numbers live
in memory, so moving a sphere or changing a color compiles nothing new.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tracer.acceleration.triangle import TriangleTables
from tracer.backends import INVALID, Backend
from tracer.color import decode_srgb
from tracer.device_meshes import SmoothTables, compile_meshes, placed_meshes
from tracer.device_shapes import (
    analytic_shapes,
    extent_of,
    geometry_rows,
    id_rows,
    kind_of,
    object_space,
    surface_rows,
)
from tracer.device_textures import compile_textures
from tracer.errors import SceneError
from tracer.last_scenes import LastScenes
from tracer.light_tables import LightTables, compile_lights
from tracer.replay import NOT_IN_KERNELS
from tracer.scene import Scene
from tracer.shafts import Enclosure
from tracer.shapes.sphere import SphereSlot
from tracer.shapes.sphere_table import SphereRows, SphereTable
from tracer.shapes.triangles import PlacedMesh
from tracer.textures.tables import TextureTables

DOCUMENT_STACK = 20
"""Pending rays of a pixel at the document's cut-off, 0.05."""


@dataclass(frozen=True)
class Options:
    """The switches of the model (document, sections 2 to 4); each variant is a kernel of its own."""

    tir_reflects: bool
    secondary_background: bool
    transparent_shadows: bool
    diffuse_is_lambert: bool


@dataclass
class HostScene:
    """What the host knows of a compiled scene, in double precision.

    `first_primitive` (shapes + 1,), `faces`: face numbers of each mesh by shape, `extent`: the largest
    |coordinate| of the finite shapes, `meshes`: placed triangles by shape.
    """

    first_primitive: np.ndarray
    meshes: dict[int, PlacedMesh] = field(default_factory=dict)
    extent: float = 0.0


@dataclass
class DeviceScene:
    """A scene in Dr.Jit memory, for one backend and precision.

    `slots`: planes and spheres that stand in the kernel one by one, in the order of the shapes;
    `sphere_rows`: these spheres once more, as a table; `sphere_table`: all spheres when they are many;
    `triangles`: those of all meshes; `enclosures`: balls around the meshes. Tables by shape, in packets of
    four: `geometry` (plane n, d or sphere center, radius), `ids` (shape kind times 256 plus texture flags,
    first color, count of colors, plane bit), `surfaces` (ior, k_r, k_t, k_a; m, h, s, texture rate),
    `object_space` (the 3x4 matrix back), `first_primitive` (one each). By primitive, when there are meshes:
    `shape_of`, and `slot_of` its triangle in the hierarchy.
    """

    backend: Backend
    options: Options
    kinds: frozenset[int]
    slots: list[Any]
    sphere_rows: SphereRows | None
    sphere_table: SphereTable | None
    triangles: TriangleTables | None
    enclosures: list[Enclosure]
    smooth: SmoothTables | None
    shape_of: Any
    slot_of: Any
    geometry: Any
    ids: Any
    first_primitive: Any
    surfaces: Any
    object_space: Any
    textures: TextureTables
    lights: LightTables
    ambient: Any
    not_ambient: Any
    background: Any
    cutoff: Any
    max_depth: Any
    stack_size: int
    host: HostScene = field(metadata=NOT_IN_KERNELS)

    @property
    def spheres(self) -> list[SphereSlot]:
        """The spheres that stand in the kernel one by one."""
        return [slot for slot in self.slots if isinstance(slot, SphereSlot)]


_LAST: LastScenes[DeviceScene] = LastScenes(variants=2, megabytes=256)


def compile_scene(scene: Scene, backend: Backend, animated: bool = False) -> DeviceScene:
    """The tables of a scene, those of the last time where nothing but the camera has changed; raises
    `SceneError` for files that cannot be used. `animated`: see `compile_lights`."""

    def make() -> tuple[DeviceScene, Iterator[Path]]:
        device = _compiled(scene, backend, animated)
        return device, (file for mesh in device.host.meshes.values() for file in mesh.data.files)

    return _LAST.get(scene, (backend, animated), make)


def _compiled(scene: Scene, backend: Backend, animated: bool) -> DeviceScene:
    meshes = placed_meshes(scene)
    counts = [len(meshes[i].corners) if i in meshes else 1 for i in range(len(scene.shapes))]
    first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    if first[-1] >= INVALID >> 1:
        raise SceneError(f"{scene.name}: {first[-1]} primitives; allowed: fewer than 2^31")
    rows = geometry_rows(scene)
    host = HostScene(first, meshes, extent_of(scene, rows, meshes))
    decode = decode_srgb if scene.color_space == "linear" else np.asarray
    slots, sphere_rows, sphere_table, planes = analytic_shapes(scene, backend, rows, first)
    tables = compile_meshes(scene, backend, meshes, first)
    textures = compile_textures(scene, backend)
    return DeviceScene(
        backend=backend,
        options=Options(
            tir_reflects=scene.tir == "reflect",
            secondary_background=scene.secondary_background,
            transparent_shadows=scene.transparent_shadows,
            diffuse_is_lambert=scene.diffuse_term == "lambert",
        ),
        kinds=frozenset(kind_of(shape) for shape in scene.shapes),
        slots=slots,
        sphere_rows=sphere_rows,
        sphere_table=sphere_table,
        triangles=tables.triangles,
        enclosures=tables.enclosures,
        smooth=tables.smooth,
        shape_of=tables.shape_of,
        slot_of=tables.slot_of,
        geometry=backend.table(rows),
        ids=backend.id_table(id_rows(scene, textures.by_shape)),
        first_primitive=backend.id_table(first[:-1] if len(first) > 1 else [0]),
        surfaces=backend.table(surface_rows(scene, textures.by_shape)),
        object_space=object_space(scene, backend),
        textures=textures.tables,
        lights=compile_lights(
            backend,
            scene.lights,
            decode(np.array([light.color for light in scene.lights]).reshape(-1, 3)),
            planes,
            scene.seed,
            animated,
        ),
        ambient=backend.opaque(scene.ambient),
        not_ambient=backend.opaque(1 - scene.ambient),
        background=backend.opaque_vector(decode(np.array(scene.background))),
        cutoff=backend.opaque(weight_floor(scene.cutoff)),
        max_depth=backend.opaque_id(scene.max_depth),
        stack_size=stack_entries(scene.cutoff, scene.max_depth),
        host=host,
    )


def weight_floor(cutoff: float) -> float:
    """Rays that weigh more are traced: those at the cut-off itself are, whatever rounding did to a product of
    shares."""
    return cutoff - 1e-6


def stack_entries(cutoff: float, max_depth: int) -> int:
    """Room for the pending rays of one pixel: they weigh <= 1 together and >= cutoff each, and one waits a
    level. Few sizes, since each is a kernel of its own: that of the document's cut-off, or a power of two."""
    needed = min(int(1 / weight_floor(cutoff)), max_depth)
    return DOCUMENT_STACK if needed <= DOCUMENT_STACK else 1 << (needed - 1).bit_length()
