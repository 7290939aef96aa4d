"""Rays that start far away from all triangles meet the same ones as in double precision, and do not test all
of them."""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np
import pytest

import tracer
from reference.bench.icosphere import icosphere
from tests.unit.test_hierarchy import scene_of
from tracer.acceleration import nearby
from tracer.acceleration.nearby import Nearby
from tracer.acceleration.traverse import visit_triangles
from tracer.arrival import segment_to
from tracer.backends import exact_arithmetic, find_backend
from tracer.device_scene import compile_scene
from tracer.intersection import closest_hit, free_ray
from tracer.leaving import departure
from tracer.light_tables import LightSample
from tracer.occlusion import hidden_by_triangle
from tracer.surface import surface_at

Array = np.ndarray

AWAY = [1e2, 1e4, 1e6, 1e8]
"""How far, in radii of the mesh."""

RAYS = 4096
LIGHT = np.array([-3.0, 0.2, 0.5])


def mesh() -> tracer.Scene:
    """1,280 triangles, about 1 from the origin."""
    vertices, faces = icosphere(8, seed=3)
    return scene_of(vertices[faces])


def over_a_floor() -> tracer.Scene:
    """The mesh over an infinite floor."""
    tree = mesh().to_dict()
    floor = {"kind": "plane", "coefficients": [0.0, 1.0, 0.0, 1.5]}
    return tracer.load(tree | {"shapes": [*tree["shapes"], floor]})


def lines(away: float) -> tuple[Array, Array]:
    """Origins and directions (RAYS, 3) of rays towards points in and near the mesh, in numbers of single
    precision."""
    rng = np.random.default_rng(int(np.log10(away)))
    targets, d = rng.uniform(-1, 1, (RAYS, 3)), rng.normal(size=(RAYS, 3))
    o = (targets + away * d / np.linalg.norm(d, axis=1)[:, None]).astype(np.float32)
    d = (targets - o).astype(np.float64)
    return o, (d / np.linalg.norm(d, axis=1)[:, None]).astype(np.float32)


def difference(away: float) -> tuple[float, float]:
    """Of the rays that hit the mesh in double precision, the share that single precision sends to another
    triangle or past all; and of the others, how far the distances are apart, in ulps."""
    o, d = lines(away)
    single, double = (
        tracer.intersect(mesh(), o, d, precision=p, backend="llvm") for p in ("single", "double")
    )
    met = double.primitive >= 0
    same = met & (single.primitive == double.primitive)
    assert met.sum() > 0.1 * RAYS
    error = np.abs(single.t[same] / double.t[same] - 1) / np.finfo(np.float32).eps
    return 1 - same.sum() / met.sum(), float(error.max(initial=0))


@pytest.mark.parametrize("away", AWAY)
def test_the_nearest_triangle_is_that_of_double_precision(away: float) -> None:
    share, ulps = difference(away)
    # An edge passes within rounding of one ray in a thousand at most. Distances round, and the length of
    # directions.
    assert share < 1e-3 and ulps < 2


def test_rays_whose_start_stays_where_it_is_are_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nearby, "FAR", 1e30)
    share, _ = difference(1e6)
    assert share > 0.1


def shadows(away: float) -> tuple[Array, Array]:
    """Masks (RAYS,) of points far out on the floor from which triangles hide the light: in single precision,
    and between the same two points in double."""
    rng = np.random.default_rng(int(np.log10(away)))
    angle = rng.uniform(-0.6, 0.3, RAYS)
    above = np.stack([away * np.cos(angle), np.ones(RAYS), away * np.sin(angle)], axis=-1)
    scene, backend = over_a_floor(), find_backend("llvm", "single")
    with exact_arithmetic():
        device = compile_scene(scene, backend)
        everything = dr.full(backend.Bool, True, RAYS)
        ray = free_ray(device, backend.Vector3(above.T), backend.Vector3(0, -1, 0))
        surface = surface_at(device, ray, closest_hit(device, ray, everything), everything)
        nothing = backend.UInt32(0)
        segment = segment_to(ray, surface, LightSample(backend.opaque_vector(LIGHT), nothing, nothing))
        found = hidden_by_triangle(device, segment, surface, ~everything, everything).numpy()
        p = surface.p.numpy().T.astype(np.float64)
    light = np.broadcast_to(LIGHT.astype(np.float32).astype(np.float64), p.shape)
    # From the light to well behind the mesh: farther on there is none.
    way = p - light
    end = light + 100 * way / np.linalg.norm(way, axis=1)[:, None]
    return found, ~tracer.visible(mesh(), light, end, precision="double", backend="llvm")


@pytest.mark.parametrize("away", AWAY)
def test_shadows_are_those_of_double_precision(away: float) -> None:
    single, double = shadows(away)
    assert 0.2 < double.mean() < 0.8
    assert np.count_nonzero(single != double) <= RAYS // 1000


def test_shadow_rays_that_do_not_start_at_the_light_are_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nearby, "FAR", 1e30)
    single, double = shadows(1e8)
    assert np.count_nonzero(single != double) > RAYS // 20


def most_tests(away: float) -> int:
    """How many triangles the busiest ray is tested against."""
    o, d = lines(away)
    backend = find_backend("llvm", "single")
    with exact_arithmetic():
        device = compile_scene(mesh(), backend)
        ray = free_ray(device, *(backend.Vector3(a.T) for a in (o, d)))
        near = Nearby.of(backend, device.triangles.lists, ray)

        def count(tests: Any, *_: Any) -> Any:
            return tests + 1

        tests = visit_triangles(
            backend,
            device.triangles,
            near.ray,
            lambda: departure(device, ray, ~near.moved),
            state=dr.zeros(backend.UInt32, RAYS),
            limit=lambda _: backend.Float(dr.inf),
            visit=count,
            active=dr.full(backend.Bool, True, RAYS),
        )
        return int(tests.numpy().max())


@pytest.mark.parametrize("away", AWAY)
def test_a_far_ray_passes_most_triangles_by(away: float) -> None:
    assert most_tests(away) < 60


def test_a_ray_that_tests_all_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nearby, "FAR", 1e30)
    assert most_tests(1e8) > 1000
