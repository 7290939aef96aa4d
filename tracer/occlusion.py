"""What stands between a shaded point and a light (document, section 4)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import drjit as dr

from tracer.acceleration.nearby import toward_point
from tracer.acceleration.traverse import Fold, Visit, visit_triangles
from tracer.bits import masks_in_word
from tracer.branches import changed_where
from tracer.device_scene import DeviceScene
from tracer.leaving import departure_to_light
from tracer.ray import Segment
from tracer.shafts import Suspects
from tracer.shapes.plane import PlaneSlot
from tracer.surface import Surface, shape_of


def hidden(scene: DeviceScene, segment: Segment, surface: Surface, suspects: Suspects, active: Any) -> Any:
    """Mask: some shape lies strictly between the surface and the light; of spheres and meshes only suspects
    are asked."""
    blocked = hidden_by_plane(scene, segment, active) | (suspects.umbra & active)
    blocked = blocked | hidden_by_sphere(scene, segment, active & ~blocked, suspects.spheres)
    return blocked | hidden_by_many(scene, segment, surface, suspects, active & ~blocked)


def hidden_by_plane(scene: DeviceScene, segment: Segment, active: Any) -> Any:
    """Mask: a plane lies strictly between the two ends."""
    # All planes with bits in one step: those whose bits differ at the two ends.
    blocked = ((segment.ray.sides ^ segment.light_sides) & segment.light_decided) != 0
    for slot in scene.slots:
        if isinstance(slot, PlaneSlot) and slot.bit is None:
            blocked = blocked | slot.blocks(segment, active)
    return blocked & active


def hidden_by_sphere(scene: DeviceScene, segment: Segment, active: Any, suspects: Any = None) -> Any:
    """Mask: a sphere that stands in the kernel lies strictly between the two ends; `suspects` (n,): the bits
    of those that may (see `Suspects`), None where nobody has looked."""
    backend, rows = scene.backend, scene.sphere_rows
    nothing = dr.full(backend.Bool, False, dr.width(segment.length))
    if rows is None:
        return nothing
    if suspects is None:
        word = masks_in_word(backend, [slot.may_block(segment, backend.epsilon) for slot in scene.spheres])
    else:
        word = suspects & ((1 << len(scene.spheres)) - 1)  # everybody may be more than there are

    def body(todo: Any, blocked: Any) -> tuple[Any, Any]:
        blocked = rows.fetch(dr.tzcnt(todo)).blocks(segment, True)
        return dr.select(blocked, 0, todo & (todo - 1)), blocked

    # Most packets pass it by. Branches in its place, one for each sphere and light, take long to compile.
    _, blocked = dr.while_loop(
        state=(dr.select(active, word, 0), nothing),
        cond=lambda todo, _: todo != 0,
        body=body,
        label="suspects",
    )
    return blocked


def hidden_by_many(
    scene: DeviceScene, segment: Segment, surface: Surface, suspects: Suspects, active: Any
) -> Any:
    """Mask: a triangle, or one of many spheres, lies strictly between the two ends, where they are
    suspects."""
    blocked = dr.full(scene.backend.Bool, False, dr.width(segment.length))
    if scene.sphere_table is not None:
        blocked = scene.sphere_table.blocks(segment, active & suspects.many)
    if scene.triangles is not None:
        blocked = hidden_by_triangle(scene, segment, surface, blocked, active & suspects.meshes & ~blocked)
    return blocked & active


def hidden_by_triangle(
    scene: DeviceScene,
    segment: Segment,
    surface: Surface,
    blocked: Any,
    active: Any,
    among: Fold | None = None,
) -> Any:
    """Mask: `blocked` already, or a triangle, of all or `among` some (see `visit_triangles`), lies strictly
    between the two ends."""
    return _visit_between(
        scene,
        segment,
        surface,
        state=blocked,
        visit=lambda blocked, _t, _primitive, _test, valid: blocked | valid,
        active=active,
        done=lambda blocked: blocked,
        among=among,
    )


def transmittance(
    scene: DeviceScene, segment: Segment, surface: Surface, suspects: Suspects, active: Any
) -> Any:
    """Share of light that arrives when every surface crossed lets k_t through (`transparent_shadows`)."""
    backend = scene.backend
    share = dr.select(active, backend.Float(1), 0)

    def passed(share: Any, slot: Any) -> Any:
        factor = _refraction_of(scene, slot.primitive)
        return share * _power_0_1_2(factor, slot.crossings(segment, active))

    for slot in scene.slots:
        if isinstance(slot, PlaneSlot):
            share = passed(share, slot)
    for number, slot in enumerate(scene.spheres):
        asked = active & ((suspects.spheres & (1 << number)) != 0)
        share = changed_where(asked, share, partial(passed, slot=slot), label="suspect")
    if scene.sphere_table is not None:
        share = scene.sphere_table.fold(
            segment, share, active & suspects.many, step=passed, done=lambda share: share == 0
        )
    if scene.triangles is not None:
        share = _visit_between(
            scene,
            segment,
            surface,
            state=share,
            visit=lambda share, _t, primitive, test, valid: dr.select(
                valid, share * _crossed(_refraction_of(scene, primitive), test.owned), share
            ),
            active=active & suspects.meshes & (share > 0),
            done=lambda share: share == 0,
        )
    return share


def _visit_between(
    scene: DeviceScene,
    segment: Segment,
    surface: Surface,
    state: Any,
    visit: Visit,
    active: Any,
    done: Callable[[Any], Any],
    among: Fold | None = None,
) -> Any:
    """`visit_triangles` between the surface and the light, from the end that tells more."""
    assert scene.triangles is not None
    ray, light, turned = toward_point(scene.triangles.lists, segment)
    return visit_triangles(
        scene.backend,
        scene.triangles,
        ray,
        lambda: departure_to_light(scene, segment.ray, surface, ~turned),
        state=state,
        limit=lambda _: segment.length,
        visit=visit,
        active=active,
        light=light,
        done=done,
        among=among,
    )


def _refraction_of(scene: DeviceScene, primitive: Any) -> Any:
    return dr.gather(scene.backend.Float, scene.surfaces, shape_of(scene, primitive, True) * 8 + 2)


def _crossed(factor: Any, owned: Any) -> Any:
    """The factor of a surface that is crossed; exactly on an edge only one of two neighbors counts, but an
    opaque one always does."""
    return dr.select(owned | (factor == 0), factor, 1)


def _power_0_1_2(factor: Any, count: Any) -> Any:
    return dr.select(count == 0, 1, dr.select(count == 1, factor, factor * factor))
