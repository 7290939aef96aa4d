"""Rays that leave a surface, and what they know of it."""

from __future__ import annotations

from typing import Any

import drjit as dr

from tracer.acceleration.departure import Departure, Ground
from tracer.acceleration.triangle import gather_triangle
from tracer.device_scene import DeviceScene
from tracer.device_shapes import KIND_UNIT, MESH, PLANE, SPHERE
from tracer.ray import Ray, departure_word, normalize, select_max
from tracer.surface import Surface, shape_of, slot_of


def departure(scene: DeviceScene, ray: Ray, active: Any) -> Departure:
    """What rays know of the surface that they leave, looked up by its id; nothing outside of the mask."""
    backend = scene.backend
    active = ray.departing & active
    kind, row = _left(scene, ray, active)
    assert scene.triangles is not None
    is_mesh = active & (kind == MESH)
    slot = slot_of(scene, ray.departure >> 1, is_mesh)
    end = dr.gather(backend.Vector4, scene.triangles.rows, slot * 4 + 2, is_mesh)
    center = backend.Vector3(row.x, row.y, row.z)
    outward = dr.select(kind == SPHERE, normalize(ray.o - center), center)
    outward = dr.select(is_mesh, backend.Vector3(end.y, end.z, end.w), outward)
    # A smooth mesh may send a ray to the other side of its facet than its word says: there the direction
    # decides.
    below = dr.select(is_mesh, dr.dot(outward, ray.d) < 0, ray.inside)
    return _departure(scene, ray, active, dr.select(below, -outward, outward))


def departure_to_light(scene: DeviceScene, ray: Ray, surface: Surface, active: Any) -> Departure:
    """The same for a ray that leaves a known surface on its lit side."""
    return _departure(scene, ray, active, surface.lit_side)


def _departure(scene: DeviceScene, ray: Ray, active: Any, normal: Any) -> Departure:
    climb = select_max(dr.dot(normal, ray.d), scene.backend.Float(0))
    return Departure(active, ray.departure >> 1, normal, lambda: _ground(scene, ray, active), ray.view, climb)


def _ground(scene: DeviceScene, ray: Ray, active: Any) -> Ground:
    """Where the surface lies that rays leave."""
    backend = scene.backend
    kind, row = _left(scene, ray, active)
    assert scene.triangles is not None
    is_mesh = active & (kind == MESH)
    triangle = gather_triangle(backend, scene.triangles.rows, slot_of(scene, ray.departure >> 1, is_mesh))
    center = backend.Vector3(row.x, row.y, row.z)
    return Ground(
        corners=tuple(dr.select(is_mesh, v, center) for v in (triangle.v0, triangle.v1, triangle.v2)),
        reach=dr.select(kind == SPHERE, row.w, dr.select(kind == PLANE, float("inf"), 0)),
    )


def _left(scene: DeviceScene, ray: Ray, active: Any) -> tuple[Any, Any]:
    """Kind and geometry of the shape that rays leave."""
    backend = scene.backend
    shape = shape_of(scene, ray.departure >> 1, active)
    kind = dr.gather(backend.IdVector4, scene.ids, shape, active).x // KIND_UNIT
    return kind, dr.gather(backend.Vector4, scene.geometry, shape, active)


def leave(ray: Ray, surface: Surface, d: Any, crosses: bool) -> Ray:
    """The ray that leaves a surface in direction d: on the side it came from, or through it."""
    inside = surface.entering if crosses else ~surface.entering
    sides = ray.sides ^ surface.ids.w if crosses else ray.sides
    return Ray(surface.p, d, departure_word(surface.primitive, inside), sides, surface.view)
