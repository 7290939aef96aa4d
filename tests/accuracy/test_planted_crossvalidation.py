"""Errors planted on purpose: the comparison with Mitsuba and extended precision catches each, and says whose
it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import Any

import drjit as dr
import numpy as np
import pytest

import tracer
from reference import mitsuba_scene
from reference.comparison import Outcome, cameras, find_terms, run
from reference.mitsuba_scene import MitsubaScene
from reference.random_scenes import random_scene
from tracer import canvas as canvas_module
from tracer import chains, device_scene, device_shapes, light_tables, queries, surface
from tracer.canvas import DeviceCanvas
from tracer.material import Material
from tracer.ray import Hit, Ray, keep_nearer
from tracer.shapes import Plane, Sphere, sphere
from tracer.shapes.sphere import SphereSlot

pytest.importorskip("mitsuba")

Plant = Callable[[pytest.MonkeyPatch], None]

RAYS = 3_000


def normal_flipped(patch: pytest.MonkeyPatch) -> None:
    true = SphereSlot.surface
    patch.setitem(
        surface.ANALYTIC_SURFACES,
        device_shapes.SPHERE,
        lambda row, p: (true(row, p)[0], -true(row, p)[1]),
    )


def eta_inverted(patch: pytest.MonkeyPatch) -> None:
    true = chains.refract_direction
    patch.setattr(chains, "refract_direction", lambda d, n, ior, entering: true(d, n, dr.rcp(ior), entering))


def total_reflection_ignored(patch: pytest.MonkeyPatch) -> None:
    """The ray goes straight on where it should not get out."""
    true = chains.refract_direction

    def always_out(d: Any, n: Any, ior: Any, entering: Any) -> tuple[Any, Any]:
        bent, total = true(d, n, ior, entering)
        return dr.select(total, d, bent), total & False

    patch.setattr(chains, "refract_direction", always_out)


def ray_offset(patch: pytest.MonkeyPatch) -> None:
    """Secondary rays start 1e-3 S off their surface."""
    true, extent = chains.leave, 0.01

    def pushed(ray: Ray, surface: Any, d: Any, crosses: bool) -> Ray:
        away = true(ray, surface, d, crosses)
        return replace(away, o=away.o + (-1e-3 if crosses else 1e-3) * extent * surface.lit_side)

    patch.setattr(chains, "leave", pushed)


def depth_from_the_eye(patch: pytest.MonkeyPatch) -> None:
    true = DeviceCanvas.ray

    def from_eye(canvas: DeviceCanvas, o: Any, d: Any) -> tuple[Any, Any]:
        return o * 0 + (canvas.center - canvas.forward), d

    patch.setattr(
        DeviceCanvas,
        "ray",
        lambda canvas, x, y: from_eye(canvas, *true(canvas, x, y)),
    )


def image_mirrored(patch: pytest.MonkeyPatch) -> None:
    true = DeviceCanvas.ray
    patch.setattr(DeviceCanvas, "ray", lambda canvas, x, y: true(canvas, 2 * canvas.half_width - x, y))


def rotation_reversed(patch: pytest.MonkeyPatch) -> None:
    true = canvas_module.cosine_sine
    patch.setattr(canvas_module, "cosine_sine", lambda degrees: true(-degrees))


def triangle_dropped(patch: pytest.MonkeyPatch) -> None:
    true = device_scene.placed_meshes

    def without_one(scene: tracer.Scene) -> dict[int, Any]:
        meshes = true(scene)
        number = min(meshes)
        corners = meshes[number].corners.copy()
        corners[0] = corners[0, 0]
        return meshes | {number: replace(meshes[number], corners=corners)}

    patch.setattr(device_scene, "placed_meshes", without_one)


def single_for_double(patch: pytest.MonkeyPatch) -> None:
    true = queries.find_backend
    for module in (queries, chains):
        patch.setattr(module, "find_backend", lambda name, precision: true(name, "single"))


def radius_off(patch: pytest.MonkeyPatch) -> None:
    true = Sphere.slot
    patch.setattr(
        Sphere, "slot", staticmethod(lambda types, row, *rest: true(types, row * [1, 1, 1, 1 + 1e-6], *rest))
    )


def plane_off(patch: pytest.MonkeyPatch) -> None:
    true = Plane.slot
    patch.setattr(
        Plane, "slot", staticmethod(lambda types, row, *rest: true(types, row * [1, 1, 1, 1 + 1e-6], *rest))
    )


def shadow_rays_too_long(patch: pytest.MonkeyPatch) -> None:
    """What lies behind a light hides it."""
    true = queries.closest_hit
    patch.setattr(queries, "closest_hit", lambda scene, ray, active, reach=None: true(scene, ray, active))


def mirror_about_another_normal(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(surface, "mirror_direction", lambda d, n: dr.fma(-1.999999 * dr.dot(n, d), n, d))


def no_departure(patch: pytest.MonkeyPatch) -> None:
    """The ray forgets what it leaves."""
    patch.setattr(Ray, "leaves", lambda ray, primitive: dr.full(dr.mask_t(ray.o.x), False, dr.width(ray.o)))
    patch.setattr(Ray, "departing", property(lambda ray: dr.full(dr.mask_t(ray.d.x), False, dr.width(ray.d))))


def farther_hit_kept(patch: pytest.MonkeyPatch) -> None:
    """A sphere hides what stands before it in the list of shapes, however far the sphere is."""

    def keep_later(hit: Hit, t: Any, valid: Any, primitive: Any) -> Hit:
        return Hit(dr.select(valid, t, hit.t), dr.select(valid, primitive, hit.primitive))

    patch.setattr(sphere, "keep_nearer", keep_later)


def light_weights_not_normalized(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(light_tables.math, "fsum", lambda weights: 1.0)


def absorbed_share_is_one(patch: pytest.MonkeyPatch) -> None:
    """A mirror shines by its own light in full, as if nothing were reflected."""
    patch.setattr(Material, "absorption", property(lambda material: 1.0))


def cutoff_doubled(patch: pytest.MonkeyPatch) -> None:
    """Rays end at twice the weight that the scene names."""
    module = import_module("tracer.passes")
    true = module.compile_scene

    def coarse(scene: tracer.Scene, *rest: Any) -> Any:
        return true(scene.model_copy(update={"cutoff": 2 * scene.cutoff}), *rest)

    patch.setattr(module, "compile_scene", coarse)


def spheres_without_shadow(patch: pytest.MonkeyPatch) -> None:
    """In the renderer alone; `tracer.visible` goes another way."""
    patch.setattr(SphereSlot, "blocks", lambda slot, segment, *rest: dr.full(type(segment.length > 0), False))


def position_moved_along_the_surface(patch: pytest.MonkeyPatch) -> None:
    """By 1e-5 S, in its plane."""
    true = queries._hits

    def moved(device: Any, hit: Any, surface: Any) -> tracer.Hits:
        hits = true(device, hit, surface)
        side = np.cross(hits.normal, [0.3, 0.5, 0.8])
        return replace(hits, position=hits.position + 1e-7 * side)

    patch.setattr(queries, "_hits", moved)


def placement_ignored(patch: pytest.MonkeyPatch) -> None:
    """Spheres stay where they were before they were scaled and moved: for all who ask the record."""
    patch.setattr(Sphere, "placed_coefficients", lambda sphere: np.array([*sphere.center, sphere.radius]))


def triangle_lost_for_all(patch: pytest.MonkeyPatch) -> None:
    """For Mitsuba as well, which gets the same placed meshes."""
    triangle_dropped(patch)
    patch.setattr(mitsuba_scene, "placed_meshes", device_scene.placed_meshes)


def sphere_met_again_from_inside(patch: pytest.MonkeyPatch) -> None:
    """A share of the rays inside a sphere meets it again at once."""
    true = SphereSlot.closest

    def again(slot: SphereSlot, ray: Ray, hit: Hit, active: Any) -> Hit:
        x = ray.o.x * 1e5
        own = ray.leaves(slot.primitive) & ray.inside & (x - dr.floor(x) < 0.02)
        return keep_nearer(true(slot, ray, hit, active), 1e-7 * slot.radius, own, slot.primitive)

    patch.setattr(SphereSlot, "closest", again)


def bent_by_index_1(patch: pytest.MonkeyPatch) -> None:
    true = chains.refract_direction

    def bent(d: Any, n: Any, ior: Any, entering: Any) -> tuple[Any, Any]:
        way, total = true(d, n, ior, entering)
        return dr.select(ior == 1, way + 1e-6 * n, way), total

    patch.setattr(chains, "refract_direction", bent)


def sub_rays_off(patch: pytest.MonkeyPatch) -> None:
    """All sub-rays of a pixel go through its center."""
    true = cameras.primary_ray

    def centered(types: Any, canvas: Any, pixels: Any, sub_ray: Any) -> tuple[Any, Any]:
        return true(types, canvas, replace(pixels, n=types.opaque_id(1)), sub_ray * 0)

    patch.setattr(cameras, "primary_ray", centered)


def pixels_inverted(patch: pytest.MonkeyPatch) -> None:
    """One in a hundred: fewer than may differ near edges, and none of them may."""
    true = tracer.render

    def inverted(*arguments: Any, **settings: Any) -> tracer.Result:
        result = true(*arguments, **settings)
        color = result.color.copy()
        color.reshape(-1, 3)[50::111] = 1 - color.reshape(-1, 3)[50::111]
        return replace(result, color=color)

    patch.setattr(tracer, "render", inverted)


def mitsuba_hits_too_far(patch: pytest.MonkeyPatch) -> None:
    """An error of the other side: its distances are 1e-4 too long."""
    true = MitsubaScene.intersect

    def stretched(scene: MitsubaScene, o: Any, d: Any, t_max: Any = None) -> Any:
        hits = true(scene, o, d, t_max)
        return replace(hits, t=1.0001 * hits.t, p=hits.p + 1e-4 * hits.t[:, None] * d)

    patch.setattr(MitsubaScene, "intersect", stretched)


def mitsuba_normals_flipped(patch: pytest.MonkeyPatch) -> None:
    true = MitsubaScene.intersect

    def flipped(scene: MitsubaScene, o: Any, d: Any, t_max: Any = None) -> Any:
        hits = true(scene, o, d, t_max)
        return replace(hits, n=-hits.n)

    patch.setattr(MitsubaScene, "intersect", flipped)


def mitsuba_not_robust(patch: pytest.MonkeyPatch) -> None:
    """Embree's quick tests of triangles, which let rays through edges."""
    true = mitsuba_scene.build

    def build(scene: tracer.Scene, *rest: Any) -> MitsubaScene:
        built = true(scene, *rest)
        mi = mitsuba_scene.mitsuba()
        shapes = {f"shape{k}": shape for k, shape in enumerate(built.scene.shapes())}
        return replace(built, scene=mi.load_dict({"type": "scene", **shapes}, optimize=False))

    patch.setattr(mitsuba_scene, "build", build)


CATCHES: list[tuple[Plant, str, str, str]] = [
    (normal_flipped, "normal, sphere", "double", "ours"),
    (normal_flipped, "normal, sphere", "single", "ours"),
    (eta_inverted, "refraction, sphere", "double", "ours"),
    (total_reflection_ignored, "total reflection", "double", "ours"),
    (ray_offset, "lockstep, next vertex, sphere", "double", "ours"),
    (ray_offset, "chain growth", "double", "ours"),
    (depth_from_the_eye, "depth buffer", "single", "ours"),
    (depth_from_the_eye, "camera rays", "single", "ours"),
    (image_mirrored, "camera rays", "single", "ours"),
    (image_mirrored, "depth buffer, mask", "single", "ours"),
    (rotation_reversed, "camera rays", "double", "ours"),
    (triangle_dropped, "hits", "double", "ours"),
    (single_for_double, "distance, sphere", "double", "ours"),
    (single_for_double, "mirror, sphere", "double", "ours"),
    (radius_off, "distance, sphere", "double", "ours"),
    (plane_off, "distance, plane", "double", "ours"),
    (shadow_rays_too_long, "visibility", "double", "ours"),
    (mirror_about_another_normal, "mirror, sphere", "double", "ours"),
    (no_departure, "lockstep, next hit", "single", "ours"),
    (farther_hit_kept, "hits", "single", "ours"),
    (light_weights_not_normalized, "picture, Mitsuba", "single", "ours"),
    (light_weights_not_normalized, "picture, plain", "double", "ours"),
    (absorbed_share_is_one, "picture, Mitsuba", "single", "ours"),
    (cutoff_doubled, "rays counted, plain", "double", "ours"),
    (spheres_without_shadow, "direct light", "double", "ours"),
    (spheres_without_shadow, "direct light", "single", "ours"),
    (position_moved_along_the_surface, "position, plane", "double", "ours"),
    (placement_ignored, "placement", "double", "ours"),
    (triangle_lost_for_all, "placement", "double", "ours"),
    (sphere_met_again_from_inside, "lockstep, next hit", "double", "ours"),
    (bent_by_index_1, "straight through", "double", "ours"),
    (sub_rays_off, "camera rays", "double", "ours"),
    (pixels_inverted, "picture, Mitsuba", "double", "ours"),
    (mitsuba_hits_too_far, "distance, sphere", "double", "mitsuba"),
    (mitsuba_hits_too_far, "chain growth", "double", "mitsuba"),
    (mitsuba_normals_flipped, "normal, mesh", "single", "mitsuba"),
    (mitsuba_not_robust, "edges and corners", "single", "mitsuba"),
]


PLACED = {
    "camera": {"resolution": [32, 24], "origin": [0, 1, 5], "target": [0, 0, 0], "fov": 50},
    "shapes": [
        {"kind": "sphere", "center": [1, 0, 0], "radius": 1, "scale": 0.5, "rotate": [0, 90, 0]},
        {"kind": "mesh", "builtin": "cube", "rotate": [10, 20, 30], "translate": [2, 0, 0]},
    ],
}


def outcome(term: str, precision: str) -> Outcome:
    """On a random scene of a plane, spheres and solids, glass and mirrors, some thousandths in size; the
    camera in the classic room, turned and with 3 x 3 rays a pixel; direct light under a disk."""
    if term == "placement":
        scene = tracer.load(PLACED)
    else:
        named = {"camera rays": "classic_rotated", "direct light": "light_disk"}
        scene = tracer.load(named[term]) if term in named else random_scene(3)
    (found,) = run([scene], find_terms([term]), (precision,), RAYS)
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("plant", "term", "precision", "guilty"),
    CATCHES,
    ids=[f"{plant.__name__}, {term}, {precision}" for plant, term, precision, _ in CATCHES],
)
def test_a_planted_error_is_caught(
    plant: Plant, term: str, precision: str, guilty: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    plant(monkeypatch)
    found = outcome(term, precision)
    assert not found.passed, f"{term} did not notice: {found}"
    assert found.guilty == guilty, str(found)
    assert found.worst is None or found.worst.command.startswith("tracer validate ")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("term", "precision"), sorted({(term, precision) for _, term, precision, _ in CATCHES})
)
def test_nothing_is_caught_without_one(term: str, precision: str) -> None:
    found = outcome(term, precision)
    assert found.passed, str(found)


def test_the_smallest_errors_are_far_above_what_is_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A radius off by 1e-6 is millions of eps in double precision."""
    radius_off(monkeypatch)
    found = outcome("distance, sphere", "double")
    assert found.ours_error > 1e6 * found.ours_allowed
    assert found.mitsuba_error <= found.mitsuba_allowed
    assert np.isfinite(found.measured)
