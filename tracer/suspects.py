"""Who may hide a light from a point: all that may lie on the ways to its samples (document, section 4)."""

from __future__ import annotations

from typing import Any

import drjit as dr

from tracer.acceleration.beam import CLEAR, COVERED, DOUBTFUL, first_verdict, look_along
from tracer.device_scene import DeviceScene
from tracer.shafts import Ball, Shaft, Suspects
from tracer.shapes.sphere import SphereSlot
from tracer.shapes.sphere_table import SphereTable
from tracer.surface import Surface


def find_suspects(
    scene: DeviceScene, surface: Surface, ball: Ball, active: Any, *, spheres: bool, beams: bool
) -> Suspects:
    """Who may hide a light, whose samples the ball holds, from the points of a surface.

    Without `spheres` only the others are looked at; without `beams` every mesh near the way is suspect. Both
    pay where they stand for several shadow rays.
    """
    backend = scene.backend
    who = Suspects.nobody(backend, dr.width(surface.p), spheres)
    shaft = Shaft.of(backend, surface.p, ball)
    for number, slot in enumerate(scene.spheres if spheres else []):
        suspect, umbra = _meet_sphere(shaft, surface, slot)
        who.spheres |= dr.select(suspect, backend.UInt32(1 << number), 0)
        who.umbra |= umbra
    if scene.sphere_table is not None:
        _find_among_many(scene, scene.sphere_table, surface, shaft, active, beams, who)
    if scene.triangles is not None:
        near = active & _near_a_mesh(scene, surface, shaft)
        if not scene.options.transparent_shadows:
            near = near & ~who.umbra
        if not beams:
            who.meshes |= near
            return who
        verdict = look_along(backend, scene.triangles, shaft, surface.lit_side, surface.primitive, near)
        who.meshes |= verdict != CLEAR
        who.umbra |= verdict == COVERED
    return who


def _meet_sphere(shaft: Shaft, surface: Surface, sphere: SphereSlot) -> tuple[Any, Any]:
    """Masks: a sphere may hide some sample of a light, and it certainly hides all."""
    found = shaft.toward(sphere.center, sphere.radius)
    # The sphere itself hides every light outside from a point inside it, and none that it faces outside.
    own, inside = surface.primitive == sphere.primitive, ~surface.entering
    return dr.select(own, inside, found.may_meet), dr.select(own, inside & found.apart, found.covered)


def _find_among_many(
    scene: DeviceScene,
    table: SphereTable,
    surface: Surface,
    shaft: Shaft,
    active: Any,
    beams: bool,
    who: Suspects,
) -> None:
    """Adds to the suspects whether one of many spheres may hide a light, or does."""
    near = active & shaft.toward(table.ball.center, table.ball.radius).may_meet
    if not beams:
        who.many |= near
        return

    def meet(slot: Any) -> Any:
        suspect, umbra = _meet_sphere(shaft, surface, table.fetch(slot))
        return dr.select(umbra, scene.backend.UInt32(COVERED), dr.select(suspect, DOUBTFUL, CLEAR))

    verdict = first_verdict(scene.backend, table.lists, shaft, meet, near)
    who.many |= verdict != CLEAR
    who.umbra |= verdict == COVERED


def _near_a_mesh(scene: DeviceScene, surface: Surface, shaft: Shaft) -> Any:
    """Mask: the shaft may meet the ball around a mesh, and not just that of a convex mesh that it leaves."""
    near = dr.zeros(scene.backend.Bool, dr.width(surface.p))
    for mesh in scene.enclosures:
        met = shaft.toward(mesh.ball.center, mesh.ball.radius).may_meet
        if mesh.convex:
            met = met & ~((surface.shape == mesh.shape) & surface.entering)
        near |= met
    return near
