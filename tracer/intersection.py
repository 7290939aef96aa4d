"""What a ray meets: the nearest hit, and the surface there.

The same functions serve the camera, the ray queries, the accuracy suite and the viewer; none of them
knows where its rays come from.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import drjit as dr

from tracer.acceleration.departure import Departure, Ground
from tracer.acceleration.nearby import Nearby
from tracer.acceleration.traverse import distance_to, visit_triangles
from tracer.acceleration.triangle import fetch_triangle, gather_triangle
from tracer.backends import INVALID
from tracer.branches import changed_where
from tracer.device_scene import DeviceScene
from tracer.device_shapes import KIND_UNIT, MESH, PLANE, SPHERE
from tracer.ray import (
    Hit,
    Ray,
    departure_word,
    keep_nearer,
    max_abs,
    mirror_direction,
    no_hit,
    normalize,
    select_max,
)
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


def free_ray(scene: DeviceScene, o: Any, d: Any) -> Ray:
    """A ray that starts anywhere: it leaves nothing, and its sides are computed."""
    backend = scene.backend
    width = max(dr.width(o), dr.width(d))
    view = None if scene.triangles is None else dr.zeros(backend.Vector3, width)
    return Ray(o, d, dr.full(backend.UInt32, INVALID, width), plane_sides(scene, o, d), view)


def plane_sides(scene: DeviceScene, o: Any, d: Any) -> Any:
    """The bits of `Ray.sides` for origins (3, n)."""
    sides = dr.zeros(scene.backend.UInt32, max(dr.width(o), dr.width(d)))
    for slot in scene.slots:
        if isinstance(slot, PlaneSlot) and slot.bit is not None:
            sides = sides | slot.side_bit(o, d)
    return sides


@dataclass
class Known:
    """What is known of rays before they are traced: `mask` (n,) of those whose nearest triangle is, and its
    `slot` (n,) in the hierarchy, `INVALID` for none."""

    mask: Any
    slot: Any


def closest_hit(
    scene: DeviceScene, ray: Ray, active: Any, t_max: Any = None, known: Known | None = None
) -> Hit:
    """The smallest t > 0 (at most `t_max` when given); of equal ones the lower shape, then the lower
    primitive."""
    hit = no_hit(scene.backend, dr.width(ray.d))
    if t_max is not None:
        hit.t = dr.select(active, t_max, hit.t)
    for slot in scene.slots:
        hit = slot.closest(ray, hit, active)
    if scene.sphere_table is not None:
        hit = scene.sphere_table.closest(ray, hit, active)
    if scene.triangles is not None:
        if known is not None:
            hit = known_triangle(scene, ray, hit, active & known.mask, known.slot)
            active = active & ~known.mask
        hit = _closest_triangle(scene, ray, hit, active)
    return hit


def closest_triangle(scene: DeviceScene, ray: Ray, active: Any) -> Hit:
    """The same among triangles alone."""
    return _closest_triangle(scene, ray, no_hit(scene.backend, dr.width(ray.d)), active)


def _closest_triangle(scene: DeviceScene, ray: Ray, hit: Hit, active: Any) -> Hit:
    """The nearest of a hit and all triangles."""
    assert scene.triangles is not None
    nearby = Nearby.of(scene.backend, scene.triangles.lists, ray)
    found = visit_triangles(
        scene.backend,
        scene.triangles,
        nearby.ray,
        lambda: departure(scene, ray, ~nearby.moved),
        state=nearby.seen(hit),
        limit=lambda hit: hit.t,
        visit=lambda hit, t, primitive, _test, valid: keep_nearer(hit, t, valid, primitive),
        active=active,
    )
    return nearby.given(found, before=hit)


def known_triangle(scene: DeviceScene, ray: Ray, hit: Hit, active: Any, slot: Any) -> Hit:
    """The nearer of a hit and of that on the triangle in a slot, which the ray is known to meet."""
    assert scene.triangles is not None
    backend, tables = scene.backend, scene.triangles

    def meet(hit: Hit) -> Hit:
        triangle, primitive = fetch_triangle(backend, tables.rows, slot)
        nearby = Nearby.of(backend, tables.lists, ray)
        t = distance_to(backend, tables.lists, nearby.ray, triangle)
        return nearby.given(keep_nearer(nearby.seen(hit), t, True, primitive), before=hit)

    found: Hit = changed_where(active & (slot != INVALID), hit, meet, label="known triangle")
    return found


def shape_of(scene: DeviceScene, primitive: Any, active: Any) -> Any:
    """Number of the shape that a primitive belongs to; without meshes they are the same."""
    if scene.shape_of is None:
        return primitive
    return dr.gather(scene.backend.UInt32, scene.shape_of, primitive, active)


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


def slot_of(scene: DeviceScene, primitive: Any, active: Any) -> Any:
    """Where a triangle stands in the hierarchy."""
    return dr.gather(scene.backend.UInt32, scene.slot_of, primitive, active)


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
        b1, b2 = barycentrics(triangle.v0, triangle.v1, triangle.v2, p)
        mixed = normalize((1 - b1 - b2) * normals.v0 + b1 * normals.v1 + b2 * normals.v2)
        mixed = dr.select(entering, mixed, -mixed)
        return dr.select(dr.dot(mixed, d) < 0, mixed, lit_side)

    wanted = dr.gather(backend.UInt32, scene.smooth.shapes, shape, active)
    return changed_where(active & (wanted == 1), lit_side, interpolated, label="smooth")


def barycentrics(v0: Any, v1: Any, v2: Any, p: Any) -> tuple[Any, Any]:
    """Weights of v1 and v2 at a point p of the triangle, by areas projected on the normal (document, section
    5.9)."""
    e1, e2, q = v1 - v0, v2 - v0, p - v0
    cross = dr.cross(e1, e2)
    area2 = dr.squared_norm(cross)
    return dr.dot(dr.cross(q, e2), cross) / area2, dr.dot(dr.cross(e1, q), cross) / area2


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
