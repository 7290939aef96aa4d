"""The surface where a ray meets it, and the look-up of what belongs to a primitive."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import drjit as dr

from tracer.acceleration.triangle import Triangle, gather_triangle
from tracer.branches import changed_where
from tracer.device_scene import DeviceScene
from tracer.device_shapes import KIND_UNIT, MESH, PLANE, SPHERE
from tracer.ray import Hit, Ray, max_abs, mirror_direction, normalize
from tracer.shapes.plane import PlaneSlot
from tracer.shapes.sphere import SphereSlot

ANALYTIC_SURFACES = {PLANE: PlaneSlot.surface, SPHERE: SphereSlot.surface}


@dataclass
class Surface:
    """The surface at n hits.

    `p`: the hit point, moved onto the surface; `outward`: geometric unit normal; `normal`: shading normal
    that faces the ray; `mirrored`: the ray's direction mirrored by it; `entering`: the ray comes from the
    side that `outward` points to; `lit_side`: geometric normal facing the ray; `shape`, `primitive`:
    numbers; `ids`: the shape's row of `DeviceScene.ids`; `view`: see `Ray`.
    """

    p: Any
    outward: Any
    normal: Any
    mirrored: Any
    lit_side: Any
    entering: Any
    shape: Any
    primitive: Any
    ids: Any
    view: Any


def shape_of(scene: DeviceScene, primitive: Any, active: Any) -> Any:
    """Number of the shape that a primitive belongs to; without meshes they are the same."""
    if scene.shape_of is None:
        return primitive
    return dr.gather(scene.backend.UInt32, scene.shape_of, primitive, active)


def slot_of(scene: DeviceScene, primitive: Any, active: Any) -> Any:
    """Where a triangle stands in the hierarchy."""
    return dr.gather(scene.backend.UInt32, scene.slot_of, primitive, active)


def surface_at(scene: DeviceScene, ray: Ray, hit: Hit, active: Any) -> Surface:
    """The surface at the hits of rays; lanes without a hit hold nothing of use."""
    backend = scene.backend
    active = active & hit.valid
    shape = shape_of(scene, hit.primitive, active)
    ids = dr.gather(backend.IdVector4, scene.ids, shape, active)
    p = dr.fma(hit.t, ray.d, ray.o)
    p, outward = _geometry_at(scene, ids.x // KIND_UNIT, shape, hit.primitive, p, active)
    entering = dr.dot(outward, ray.d) < 0
    lit_side = dr.select(entering, outward, -outward)
    normal = lit_side
    if scene.smooth is not None:
        normal = _smooth_normal(scene, shape, hit.primitive, p, ray.d, lit_side, entering, active)
    view = None
    if scene.triangles is not None:
        at_origin = ray.departing & (hit.t <= 8 * backend.epsilon * max_abs(p))
        view = dr.select(at_origin, ray.view, -ray.d)  # a ray that did not move has seen nothing new
    mirrored = mirror_direction(ray.d, normal)
    return Surface(p, outward, normal, mirrored, lit_side, entering, shape, hit.primitive, ids, view)


def _geometry_at(
    scene: DeviceScene, kind: Any, shape: Any, primitive: Any, p: Any, active: Any
) -> tuple[Any, Any]:
    """Points moved onto their surfaces along the normal, and the outward unit normals there."""
    backend = scene.backend
    row = dr.gather(backend.Vector4, scene.geometry, shape, active)
    point, normal = p, dr.zeros(backend.Vector3, dr.width(p))
    for analytic, surface in ANALYTIC_SURFACES.items():
        if analytic in scene.kinds:
            on_shape = partial(lambda _, surface: surface(row, p), surface=surface)
            point, normal = changed_where(
                active & (kind == analytic), (point, normal), on_shape, label="on a shape"
            )
    if scene.triangles is not None:
        tables = scene.triangles.rows

        def on_triangle(_: Any) -> tuple[Any, Any]:
            triangle = gather_triangle(backend, tables, slot_of(scene, primitive, True))
            height = dr.dot(triangle.normal, p - triangle.v0)
            return dr.fma(-height, triangle.normal, p), triangle.normal

        point, normal = changed_where(
            active & (kind == MESH), (point, normal), on_triangle, label="on a triangle"
        )
    return point, normal


def _smooth_normal(
    scene: DeviceScene,
    shape: Any,
    primitive: Any,
    p: Any,
    d: Any,
    lit_side: Any,
    entering: Any,
    active: Any,
) -> Any:
    """The interpolated vertex normal on the lit side; the geometric one where it would face away from the
    ray."""
    assert scene.smooth is not None and scene.triangles is not None
    backend = scene.backend
    triangles, vertex_normals = scene.triangles.rows, scene.smooth.normals

    def interpolated(lit_side: Any) -> Any:
        slot = slot_of(scene, primitive, True)
        triangle = gather_triangle(backend, triangles, slot)
        normals = gather_triangle(backend, vertex_normals, slot)
        b1, b2 = barycentrics(triangle, p)
        mixed = normalize((1 - b1 - b2) * normals.v0 + b1 * normals.v1 + b2 * normals.v2)
        mixed = dr.select(entering, mixed, -mixed)
        return dr.select(dr.dot(mixed, d) < 0, mixed, lit_side)

    wanted = dr.gather(backend.UInt32, scene.smooth.shapes, shape, active)
    return changed_where(active & (wanted == 1), lit_side, interpolated, label="smooth")


def barycentrics(triangle: Triangle, p: Any) -> tuple[Any, Any]:
    """Weights of v1 and v2 at a point p of the triangle, by areas projected on its unit normal (document,
    section 5.9).

    Products of two lengths alone: those of four, as in |cross|², leave the range of single precision where
    edges are 1e10 or 1e-10 long.
    """
    e1, e2, q, n = triangle.v1 - triangle.v0, triangle.v2 - triangle.v0, p - triangle.v0, triangle.normal
    area2 = dr.dot(dr.cross(e1, e2), n)
    return dr.dot(dr.cross(q, e2), n) / area2, dr.dot(dr.cross(e1, q), n) / area2
