"""Whole pictures: `tracer` in single precision against the document's formula on Mitsuba's hits.

Two programs, two ways to avoid self-hits, one model. A pixel may differ where a decision is grazing, as the
reference itself shows (`reference/comparison/doubt.py`). Such pixels are counted.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tracer
from reference import plain
from reference.tolerances import EPSILON, TOLERANCES
from tests.accuracy import worlds
from tests.accuracy.test_against_plain import describe
from tracer.assets import builtin_scenes

pytest.importorskip("mitsuba")

from reference import whitted
from reference.comparison.doubt import doubt
from reference.comparison.renders import distance
from reference.mitsuba_scene import build

QUICK = ("glasses", "disk jitter", "transparent shadows", "smooth glass", "affine picture", "two by two")
LONGER_SIDE = 64  # pixels of a built-in scene
COUNTED = ("total_internal", "ended_by_cutoff", "ended_by_depth", "deepest_level")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return worlds.write_files(tmp_path_factory.mktemp("worlds"))


def feature(name: str, folder: Path) -> tracer.Scene:
    return tracer.load(worlds.FEATURES[name](), base_dir=folder)


def builtin(name: str) -> tracer.Scene:
    """The scene in few pixels, with as many rays a pixel as it asks for."""
    scene = tracer.load(name)
    camera, (width, height) = scene.camera, scene.camera.resolution
    share = min(1.0, LONGER_SIDE / max(width, height))
    camera.resolution = (round(width * share), round(height * share))
    if not camera.is_look_at:
        camera.pixel_size *= width / camera.resolution[0]
    return scene


def counts_of(result: tracer.Result) -> dict[str, int]:
    return result.stats["rays"] | {key: result.stats[key] for key in COUNTED}


def compare(scene: tracer.Scene) -> None:
    """Colors, coverage and counts of a scene, whose depth of field is taken out."""
    scene.camera.depth_of_field = None
    ours, theirs = tracer.render(scene, precision="single"), whitted.render(scene)
    difference = distance(ours.color, ours.depth, theirs.color, theirs.depth)
    differs = difference > TOLERANCES["color, Mitsuba"].value
    if differs.any():
        unexplained = differs & (doubt(scene, build(scene).extent) < difference / 2)
        assert not unexplained.any(), describe(unexplained, ours.color, theirs.color)
        assert differs.mean() <= TOLERANCES["grazing pixels"].value, f"{differs.mean():.1%} are left out"
    for kind, count in counts_of(ours).items():
        slack = 2 + TOLERANCES["differing rays"].value * count if differs.any() else 0
        assert abs(theirs.counts[kind] - count) <= slack, f"{kind}: tracer {count}, {theirs.counts[kind]}"


@pytest.mark.parametrize("name", QUICK)
def test_picture(name: str, folder: Path) -> None:
    compare(feature(name, folder))


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(worlds.FEATURES) - set(QUICK)))
def test_every_feature(name: str, folder: Path) -> None:
    compare(feature(name, folder))


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(builtin_scenes()))
def test_every_builtin_scene(name: str) -> None:
    compare(builtin(name))


def test_a_crop_is_a_part_of_the_picture(folder: Path) -> None:
    scene = feature("rectangle jitter", folder)
    whole, part = whitted.render(scene), whitted.render(scene, crop=(5, 3, 24, 14))
    assert np.array_equal(part.color, whole.color[3:14, 5:24])
    assert np.array_equal(part.depth, whole.depth[3:14, 5:24])
    assert part.counts["primary"] == 19 * 11


def test_colors_alone_are_those_of_the_picture(folder: Path) -> None:
    scene = feature("tir reflect", folder)
    maker = whitted.Whitted(scene, supersample=2)
    expected = maker.render().color
    for _ in range(2):
        assert np.abs(maker.color() - expected).max() <= 4 * EPSILON["single"]


def test_a_kernel_with_a_smaller_stack_is_not_taken_for_one_with_a_larger() -> None:
    """Dr.Jit knows a kernel by its text, in which the size of local memory does not stand."""
    table, crop = worlds.FEATURES["tir reflect"](), (6, 8, 18, 16)
    for cutoff in (0.9, 0.3, 0.004):
        found = whitted.render(tracer.load(table | {"cutoff": cutoff}), crop=crop)
    assert found.counts == plain.render(plain.load(table | {"cutoff": 0.004}), crop=crop).counts
