"""What spares shadow rays changes no picture: the bytes are as with one for every sample and shape."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import drjit as dr
import pytest

import tracer
from tests.accuracy import worlds
from tracer import few_lights, many_lights
from tracer.device_scene import DeviceScene
from tracer.shafts import Suspects
from tracer.surface import Surface


def everybody(scene: DeviceScene, surface: Surface, *_: Any, **__: Any) -> Suspects:
    return Suspects.everybody(scene.backend, dr.width(surface.p))


def check_picture(table: dict[str, Any], folder: Any, precision: str, patch: pytest.MonkeyPatch) -> None:
    """The same bytes as with a shadow ray for every sample and shape."""
    scene = tracer.load(table, base_dir=folder)
    spared = tracer.render(scene, precision=precision)
    with patch.context() as plain:
        for lights in (few_lights, many_lights):
            plain.setattr(lights, "find_suspects", everybody)
        asked = tracer.render(scene, precision=precision)
    assert spared.color.tobytes() == asked.color.tobytes()


def ring_of_spheres() -> worlds.Table:
    """Many spheres, meshes and an area light between them."""
    table = worlds.FEATURES["many spheres"]()
    light = {"kind": "sphere", "center": [0.3, 3.1, 2.2], "radius": 0.7, "samples": 6, "weight": 3.0}
    return table | {"lights": [*worlds.POINT_LIGHTS, light]}


def beside_meshes() -> worlds.Table:
    """A light that jitters low over smooth meshes, one of them transparent."""
    table = worlds.FEATURES["smooth glass"]()
    light = {"kind": "disk", "center": [-0.7, 2.9, 3.1], "normal": [0.2, -1, 0], "radius": 1.9, "samples": 5}
    return table | {"lights": [worlds.POINT_LIGHTS[0], light | {"jitter": True}]}


PICTURES: dict[str, Callable[[], worlds.Table]] = {
    "spheres": ring_of_spheres,
    "meshes": beside_meshes,
    **{
        name: worlds.FEATURES[name]
        for name in (
            "sphere light",
            "rectangle jitter",
            "transparent shadows",
            "many transparent",
            "flat meshes",
        )
    },
    **{f"random {seed}": partial(worlds.random_scene, seed) for seed in range(4)},
}
QUICK = ("sphere light", "meshes")


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in PICTURES]
)
def test_a_picture_in_single_precision(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check_picture(PICTURES[name](), worlds.write_files(tmp_path), "single", monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_in_double_precision(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check_picture(PICTURES[name](), worlds.write_files(tmp_path), "double", monkeypatch)
