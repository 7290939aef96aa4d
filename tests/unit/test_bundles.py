"""Bundles of primary rays: what they call certain a single ray finds, and no picture depends on them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np
import pytest

import tracer
from tests.accuracy import worlds
from tests.accuracy.worlds import icosphere
from tests.unit.test_hierarchy import pile, scene_of, single, slivers, soup
from tracer import first_hits
from tracer.acceleration import bundles as bundles_module
from tracer.acceleration import candidates, first_of_bundles
from tracer.acceleration.bundles import DOUBTFUL, RAYS
from tracer.acceleration.first_of_bundles import Bundles, nearest_of_bundles
from tracer.acceleration.triangle import TRIANGLE_WORDS
from tracer.backends import Backend, exact_arithmetic, find_backend
from tracer.camera import Camera
from tracer.canvas import Canvas, DeviceCanvas
from tracer.device_scene import DeviceScene, compile_scene
from tracer.first_hits import nearest_among
from tracer.intersection import closest_triangle, free_ray

Array = np.ndarray
PIXELS = 64


def heights() -> Array:
    """A smooth hill over a grid: triangles that share edges along rows of pixels."""
    x, y = np.meshgrid(np.linspace(-1, 1, 17), np.linspace(-1, 1, 17))
    p = np.stack([x, y, 0.3 * np.exp(-3 * (x * x + y * y))], axis=-1)
    a, b, c, d = p[:-1, :-1], p[:-1, 1:], p[1:, 1:], p[1:, :-1]
    return single(np.concatenate([np.stack(t, axis=2).reshape(-1, 3, 3) for t in ((a, b, c), (a, c, d))]))


def shells() -> Array:
    """A sphere within a sphere that is larger by less than rounding shows, and one by a little more."""
    vertices, faces = icosphere(2)
    return single(np.concatenate([vertices[faces] * size for size in (1, 1 + 2e-7, 1 + 1e-5)]))


SOUPS: dict[str, Callable[[], Array]] = {
    "soup": lambda: soup(6, 300, 1.0),
    "fine soup": lambda: soup(7, 4000, 0.1),
    "slivers": lambda: slivers(8, 200),
    "walls": lambda: pile(9),
    "hill": heights,
    "shells": shells,
    "far": lambda: single(soup(10, 300, 1.0) + 300),
    "huge": lambda: single(soup(11, 300, 1.0) * 1e15),
    "one": lambda: soup(12, 1, 1.0),
}


def cameras(corners: Array) -> list[Canvas]:
    """From outside, from inside, in the plane of a triangle, along an axis, and straight onto an edge."""
    rng = np.random.default_rng(4)
    middle, size = corners.mean(axis=(0, 1)), float(np.ptp(corners, axis=(0, 1)).max())
    corner, edge = corners[0, 0], corners[0, 1] - corners[0, 0]
    toward = rng.normal(size=(3, 3))
    toward *= 2 * size / np.linalg.norm(toward, axis=1)[:, None]
    eyes = [middle + toward[0], middle + toward[1], middle, corner - 2 * edge, middle + [0, 0, 2 * size]]
    targets = [middle, corner, middle + toward[2], corner + edge, middle]
    return [
        Canvas.of(
            Camera(
                origin=tuple(eye),
                target=tuple(target),
                up=(0.3, 1.0, 0.1) if k < 4 else (0.0, 1.0, 0.0),
                fov=50.0,
                distance=size * [0.01, 1.5, 0.01, 0.01, 1.0][k],
                resolution=(PIXELS, PIXELS),
            )
        )
        for k, (eye, target) in enumerate(zip(eyes, targets, strict=True))
    ]


def picture_rays(backend: Backend, canvas: Canvas) -> tuple[DeviceCanvas, Callable[[Any], tuple[Any, Any]]]:
    """The rays of a picture by number: blocks of 4 x 4 pixels, row by row within each."""
    device = DeviceCanvas.of(backend, canvas)

    def ray_of(number: Any) -> tuple[Any, Any]:
        block, place = number >> 4, number & 15
        across = PIXELS // 4
        column = (block & (across - 1)) * 4 + (place & 3)
        row = (block >> 4) * 4 + (place >> 2)
        return device.ray(backend.Float(column) + device.offset, backend.Float(row) + device.offset)

    assert PIXELS // 4 == 16
    return device, ray_of


def both_ways(device: DeviceScene, canvas: Canvas, both: bool = False) -> tuple[Array, Array, Array]:
    """Primitives by bundles alone, by bundles and the candidates that they note (`DOUBTFUL`: neither tells),
    and ray by ray; `both`: by the kernel for directions of both signs."""
    backend = device.backend
    assert device.triangles is not None
    with exact_arithmetic():
        on_device, ray_of = picture_rays(backend, canvas)
        bundle = dr.arange(backend.UInt32, PIXELS**2 // RAYS)
        bundles = Bundles.of(on_device.eye, [ray_of(bundle * RAYS + k) for k in range(RAYS)])
        found = nearest_of_bundles(backend, device.triangles, bundles, both)
        dr.eval(found)
        assert not (both and found.unknown.numpy().any())
        places = dr.arange(backend.UInt32, PIXELS**2)
        ray = free_ray(device, *ray_of(places))
        is_open = found.is_open(places)
        certain = dr.select(is_open, DOUBTFUL, found.answers)
        settled = dr.select(is_open, nearest_among(device, ray, found, places), found.answers)
        dr.eval(certain, settled)
        singly = closest_triangle(device, ray, dr.full(backend.Bool, True, PIXELS**2)).primitive.numpy()
    primitive_of = device.triangles.rows.numpy().reshape(-1, TRIANGLE_WORDS)[:, 12:14] @ [65536, 1]
    return primitives(primitive_of, certain.numpy()), primitives(primitive_of, settled.numpy()), singly


def primitives(primitive_of: Array, slots: Array) -> Array:
    """Those in slots of the hierarchy; what is no slot stays."""
    is_slot = slots < len(primitive_of)
    return np.where(is_slot, primitive_of[np.where(is_slot, slots, 0)], slots)


def compare(name: str, precision: str) -> None:
    corners = SOUPS[name]()
    device = compile_scene(scene_of(corners), find_backend("llvm", precision))
    for number, canvas in enumerate(cameras(corners)):
        for both in (False, True):
            *ways, singly = both_ways(device, canvas, both)
            for way, found in zip(("certain", "candidates"), ways, strict=True):
                wrong = (found != DOUBTFUL) & (found != singly)
                assert not wrong.any(), f"camera {number}, {both}, {way}: {int(wrong.sum())} of {wrong.size}"


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("name", SOUPS)
def test_what_bundles_call_certain_is_what_single_rays_find(name: str, precision: str) -> None:
    compare(name, precision)


def test_too_little_doubt_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(first_of_bundles, "ROUNDING", 0.0)
    with pytest.raises(AssertionError):
        for name in SOUPS:
            compare(name, "single")


@pytest.mark.parametrize(("precision", "most"), [("single", 0.02), ("double", 0.001)])
def test_few_rays_are_doubtful(precision: str, most: float) -> None:
    """Those of bundles with directions of both signs on an axis go to the kernel for these."""
    vertices, faces = icosphere(1)
    corners = single(vertices[faces])
    device = compile_scene(scene_of(corners), find_backend("llvm", precision))
    canvas = cameras(corners)[0]
    _, ray_of = picture_rays(device.backend, canvas)
    d = np.sign(ray_of(dr.arange(device.backend.UInt32, PIXELS**2))[1].numpy()).reshape(3, -1, RAYS)
    one_sign = np.repeat((d == d[..., :1]).all(axis=(0, 2)), RAYS)
    assert 0.7 < one_sign.mean() < 0.99
    for both in (False, True):
        found, _, singly = both_ways(device, canvas, both)
        assert (singly < len(corners)).mean() > 0.2
        assert (found[one_sign] == DOUBTFUL).mean() < most
        assert (found[~one_sign] == DOUBTFUL).mean() < most if both else (found[~one_sign] == DOUBTFUL).all()


def test_bundles_that_meet_too_many_triangles_are_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(first_of_bundles, "MOST_TRIANGLES", 2)
    corners = SOUPS["fine soup"]()
    device = compile_scene(scene_of(corners), find_backend("llvm"))
    _, found, singly = both_ways(device, cameras(corners)[0])
    assert (found == DOUBTFUL).mean() > 0.3
    assert ((found == DOUBTFUL) | (found == singly)).all()


def test_candidates_decide_unless_there_are_too_many(monkeypatch: pytest.MonkeyPatch) -> None:
    corners = SOUPS["shells"]()
    device = compile_scene(scene_of(corners), find_backend("llvm"))
    canvas = cameras(corners)[0]
    certain, settled, _ = both_ways(device, canvas, both=True)
    assert (certain == DOUBTFUL).mean() > 2 * (settled == DOUBTFUL).mean()
    for module in (candidates, bundles_module):
        monkeypatch.setattr(module, "MOST", 1)
    certain, settled, singly = both_ways(device, canvas, both=True)
    assert (certain == DOUBTFUL).mean() == (settled == DOUBTFUL).mean()
    assert ((settled == DOUBTFUL) | (settled == singly)).all()


def test_hopes_that_did_not_hold_are_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    """Behind a triangle that a ray just misses lies what the bundle has left out."""
    monkeypatch.setattr(first_hits, "HELD", 1e9)
    with pytest.raises(AssertionError, match="candidates"):
        for name in SOUPS:
            compare(name, "single")


# ---- Pictures ----------------------------------------------------------------------------------------------


def picture(scene: tracer.Scene, patch: pytest.MonkeyPatch, bundled: bool, **settings: Any) -> Any:
    patch.setattr(first_hits, "FEWEST_RAYS", 0 if bundled else 1 << 40)
    for threshold in ("SMALLEST_EDGE", "SMALLEST_SHADOW_EDGE", "SMALLEST_SHARE"):
        patch.setattr(first_hits, threshold, 0.0)
    return tracer.render(scene, **settings)


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("name", ["flat meshes", "smooth glass", "ugly mesh"])
def test_no_picture_depends_on_bundles(
    name: str, precision: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    scene = tracer.load(worlds.FEATURES[name](), base_dir=worlds.write_files(tmp_path))
    for settings in ({}, {"supersample": 3, "crop": (5, 3, 30, 21), "aovs": "all"}):
        ones, others = (
            picture(scene, monkeypatch, bundled, precision=precision, **settings) for bundled in (True, False)
        )
        assert ones.color.tobytes() == others.color.tobytes()
        assert ones.depth.tobytes() == others.depth.tobytes()
        assert all(ones.aovs[k].tobytes() == others.aovs[k].tobytes() for k in ones.aovs)
        assert ones.stats["rays"] == others.stats["rays"]


def test_bundles_are_used_where_they_pay(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Many rays, and triangles that are not much smaller than pixels."""
    asked: list[bool] = []
    bundled = first_hits.bundled
    monkeypatch.setattr(first_hits, "bundled", lambda *a: asked.append(a[-1]) or bundled(*a))
    scene = tracer.load(worlds.FEATURES["flat meshes"](), base_dir=worlds.write_files(tmp_path))
    tracer.render(scene, resolution=(512, 512))
    assert asked.count(False) == 1
    tracer.render(scene, resolution=(64, 64))
    assert asked.count(False) == 1
    monkeypatch.setattr(first_hits, "SMALLEST_EDGE", 1e9)
    tracer.render(scene, resolution=(512, 512))
    assert asked.count(False) == 1
