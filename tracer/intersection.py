"""The nearest hit of rays.

The same functions serve the camera, the ray queries, the accuracy suite and the viewer; none of them
knows where its rays come from.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.acceleration.nearby import Nearby
from tracer.acceleration.traverse import distance_to, visit_triangles
from tracer.acceleration.triangle import fetch_triangle
from tracer.backends import INVALID
from tracer.branches import changed_where
from tracer.device_scene import DeviceScene
from tracer.leaving import departure
from tracer.ray import Hit, Ray, keep_nearer, no_hit
from tracer.shapes.plane import PlaneSlot


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
