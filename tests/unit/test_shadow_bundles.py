"""Bundles of shadow rays: what they call certain a single one finds, and they are used where they pay."""

from __future__ import annotations

from pathlib import Path

import drjit as dr
import numpy as np
import pytest

import tracer
from tests.accuracy import worlds
from tests.unit.test_bundles import PIXELS, SOUPS, cameras
from tests.unit.test_hierarchy import scene_of
from tracer import first_hits, first_shadows
from tracer.acceleration import shadows_of_bundles
from tracer.acceleration.bundles import DOUBTFUL, RAYS, Found
from tracer.acceleration.shadows_of_bundles import HIDDEN, LIT
from tracer.backends import Backend, exact_arithmetic, find_backend
from tracer.canvas import Canvas, DeviceCanvas
from tracer.device_scene import compile_scene
from tracer.pixels import BandLanes
from tracer.tiles import Band

Array = np.ndarray


def lights(corners: Array) -> Array:
    """(n, 3): outside, far away, inside, in the plane of a triangle, on a corner, and on a surface."""
    middle, size = corners.mean(axis=(0, 1)), float(np.ptp(corners, axis=(0, 1)).max())
    a, b, c = corners[0]
    toward = np.random.default_rng(6).normal(size=(2, 3))
    outside, far = middle + size * toward[0], middle + 50 * size * toward[1]
    return np.array([outside, far, middle, 3 * a - b - c, a, (a + b + c) / 3])


def answers(
    corners: Array, light: Array, canvas: Canvas, backend: Backend
) -> tuple[list[Array], Array, Array]:
    """By the kernels for bundles of one sign on each axis and of both, without and with candidates; ray by
    ray; and mask of the points that ask."""
    scene = scene_of(corners)
    floor = {"kind": "plane", "coefficients": [0, 1, 0, -float(corners[..., 1].min())]}
    tree = {
        "shapes": [*scene.to_dict()["shapes"], floor],
        "lights": [{"kind": "point", "position": light.tolist()}],
    }
    scene = tracer.load(tree)
    device, on_device = compile_scene(scene, backend), DeviceCanvas.of(backend, canvas)
    lanes = BandLanes.of(backend, Band(0, 0, PIXELS, PIXELS), PIXELS, 1)
    numbers = dr.arange(backend.UInt32, lanes.count)
    with exact_arithmetic():
        slots = first_hits.singly(device, on_device, lanes, numbers)["slot"]
        points = first_shadows.lit_points(device, on_device, lanes, slots)
        where = list(points.values())
        (sample,) = first_shadows.lights_asked(device)[0].samples
        question = first_shadows.Question(device, on_device, lanes, slots, sample)
        bundles = dr.arange(backend.UInt32, lanes.count // RAYS)
        found = []
        for both in (False, True):
            by_bundles = Found(**first_shadows.bundled(device, sample.position, where, bundles, both))
            by_candidates = first_shadows.among(question, by_bundles, numbers, numbers)["hidden"]
            is_open = by_bundles.is_open(numbers)
            found.append(dr.select(is_open, DOUBTFUL, by_bundles.answers).numpy())
            found.append(dr.select(is_open, by_candidates, by_bundles.answers).numpy())
        alone = first_shadows.singly(question, numbers)["hidden"].numpy()
    return found, alone, where[-1].numpy() > 0


def compare(name: str, precision: str, most: int = 6) -> tuple[float, float]:
    """With the first `most` lights. Of the points that ask the shares of doubtful ones, by the kernel for
    both signs, and of hidden ones among the others."""
    corners, backend = SOUPS[name](), find_backend("llvm", precision)
    asked, doubtful, hidden = 0, 0, 0
    for eye, canvas in enumerate(cameras(corners)[:2]):
        for number, light in enumerate(lights(corners)[:most]):
            by_kernel, alone, asks = answers(corners, light, canvas, backend)
            for found in by_kernel:
                certain = asks & (found != DOUBTFUL)
                wrong = certain & (found != alone)
                assert not wrong.any(), (
                    f"camera {eye}, light {number}: {int(wrong.sum())} of {int(asks.sum())}"
                )
                assert (found[~asks] == LIT).all()
            asked, doubtful = asked + int(asks.sum()), doubtful + int((asks & ~certain).sum())
            hidden += int((certain & (found == HIDDEN)).sum())
    assert asked > 1000
    return doubtful / asked, hidden / max(1, asked - doubtful)


@pytest.mark.parametrize("precision", ["single", pytest.param("double", marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", SOUPS)
def test_what_bundles_call_certain_is_what_single_rays_find(name: str, precision: str) -> None:
    compare(name, precision)


def test_they_find_both_light_and_shadow() -> None:
    doubtful, hidden = compare("hill", "single", most=2)
    assert doubtful < 0.1 and 0.05 < hidden < 0.95


def test_too_little_doubt_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shadows_of_bundles, "ROUNDING", 0.0)
    with pytest.raises(AssertionError):
        for name in SOUPS:
            compare(name, "single")


def test_a_reach_that_forgets_the_surface_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neighbors in the tangent plane of the point would hide the light."""
    monkeypatch.setattr(
        first_shadows, "certain_reach", lambda backend, tables, p, normal, light: dr.norm(light - p) * 2
    )
    with pytest.raises(AssertionError):
        for name in SOUPS:
            compare(name, "single")


def test_they_are_used_where_they_pay(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Where triangles take much of the picture, and are not much smaller than pixels."""
    asked: list[bool] = []
    bundled = first_shadows.bundled
    monkeypatch.setattr(first_shadows, "bundled", lambda *a: asked.append(a[-1]) or bundled(*a))
    scene = tracer.load(worlds.FEATURES["flat meshes"](), base_dir=worlds.write_files(tmp_path))
    tracer.render(scene, resolution=(512, 512))
    assert asked.count(False) == len(scene.lights)
    for threshold in ("SMALLEST_SHADOW_EDGE", "SMALLEST_SHARE"):
        with monkeypatch.context() as patch:
            patch.setattr(first_hits, threshold, 1e9)
            tracer.render(scene, resolution=(512, 512))
    assert asked.count(False) == len(scene.lights)
