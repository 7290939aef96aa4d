"""Whole pictures: `tracer` against `reference.plain`, which another person wrote from the same document.

In double precision no pixel is left out and every kind of ray is counted alike. In single precision the
edges are: pixels whose double-precision color moves when the canvas moves by the rounding of single
precision.
"""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tracer
from reference import plain
from reference.tolerances import TOLERANCES
from tests.accuracy import worlds

QUICK = (
    "room",
    "glasses",
    "disk jitter",
    "transparent shadows",
    "smooth glass",
    "placed",
    "literal",
    "depth of field",
)
SMALL = [16, 12]
EDGE_STEPS = ((16, 0.5e-4), (128, 0.02))
"""Roundings of single precision at 16 units, and the change of color by them that makes a pixel an edge.

The larger step finds the borders of texture cells: their small value is 1e-5 of the largest coordinate in
single precision.
"""

COUNTED = ("total_internal", "ended_by_cutoff", "ended_by_depth", "deepest_level")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return worlds.write_files(tmp_path_factory.mktemp("worlds"))


def counts_of(result: tracer.Result) -> dict[str, int]:
    return result.stats["rays"] | {key: result.stats[key] for key in COUNTED}


def describe(where: np.ndarray, mine: np.ndarray, theirs: np.ndarray) -> str:
    """The first pixels that differ, with both answers."""
    lines = [
        f"pixel ({i}, {j}): tracer {mine[j, i].tolist()}, plain {theirs[j, i].tolist()}"
        for j, i in np.argwhere(where)[:5]
    ]
    return f"{int(where.sum())} of {where.size} pixels differ\n" + "\n".join(lines)


def compare_double(table: dict[str, Any], folder: Path, **settings: Any) -> None:
    mine = tracer.render(tracer.load(table, base_dir=folder), precision="double", **settings)
    theirs = plain.render(plain.load(table, folder), **settings)
    far = np.abs(mine.color - theirs.color).max(axis=2) > TOLERANCES["color, double"].value
    assert not far.any(), describe(far, mine.color, theirs.color)
    deep = np.abs(mine.depth - theirs.depth) > TOLERANCES["depth, double"].value * np.abs(theirs.depth).max()
    assert not deep.any(), describe(deep, mine.depth, theirs.depth)
    assert np.array_equal(mine.alpha, theirs.coverage.astype(np.float32))
    assert counts_of(mine) == theirs.counts


def compare_single(table: dict[str, Any], folder: Path) -> tuple[float, float]:
    """Largest difference away from edges, and the share of edge pixels."""
    scene = tracer.load(table, base_dir=folder)
    single = tracer.render(scene, precision="single")
    double = tracer.render(scene, precision="double")
    theirs = plain.render(plain.load(table, folder))
    edge = np.zeros(double.depth.shape, bool)
    for steps, jump in EDGE_STEPS:
        for shift in steps * np.vstack([np.eye(3), -np.eye(3)]):
            moved = tracer.render(tracer.load(shifted(table, shift), base_dir=folder), precision="double")
            edge |= np.abs(moved.color - double.color).max(axis=2) > jump
            edge |= (moved.depth < 0) != (double.depth < 0)
    difference = np.abs(single.color - theirs.color).max(axis=2)
    far = ~edge & (difference > TOLERANCES["color, single"].value)
    assert not far.any(), describe(far, single.color, theirs.color)
    assert edge.mean() <= TOLERANCES["edge pixels"].value, f"{edge.mean():.1%} of the pixels are edges"
    for kind, count in theirs.counts.items():
        slack = 2 + TOLERANCES["differing rays"].value * count
        assert abs(counts_of(single)[kind] - count) <= slack, (
            f"{kind}: {counts_of(single)[kind]}, plain {count}"
        )
    return float(np.where(edge, 0, difference).max()), float(edge.mean())


def shifted(table: dict[str, Any], steps: np.ndarray) -> dict[str, Any]:
    """The scene with its camera moved by so many roundings of single precision at 16 units."""
    camera = copy.deepcopy(table["camera"])
    for key in ("position", "origin", "target"):
        if key in camera:
            camera[key] = (np.array(camera[key]) + 2.0**-24 * 16 * steps).tolist()
    return table | {"camera": camera}


def small(table: dict[str, Any]) -> dict[str, Any]:
    """The same view in few pixels."""
    camera = table["camera"] | {"resolution": SMALL}
    if "pixel_size" in camera:
        camera["pixel_size"] *= worlds.RESOLUTION[0] / SMALL[0]
    return table | {"camera": camera}


@pytest.mark.parametrize("name", QUICK)
def test_picture_in_double_precision(name: str, folder: Path) -> None:
    compare_double(small(worlds.FEATURES[name]()), folder)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(worlds.FEATURES))
def test_every_feature_in_double_precision(name: str, folder: Path) -> None:
    compare_double(worlds.FEATURES[name](), folder)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_random_scene_in_double_precision(seed: int, folder: Path) -> None:
    compare_double(small(worlds.random_scene(seed)), folder)


@pytest.mark.parametrize("name", ["room", "flat meshes"])
def test_picture_in_single_precision(name: str, folder: Path) -> None:
    compare_single(small(worlds.FEATURES[name]()), folder)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(worlds.FEATURES) - {"depth of field", "depth of field, near"}))
def test_every_feature_in_single_precision(name: str, folder: Path) -> None:
    compare_single(worlds.FEATURES[name](), folder)


@pytest.mark.parametrize(
    "settings", [{"crop": (3, 2, 13, 9)}, {"supersample": 2}, {"scale": 0.5}, {"scale": 1.3}]
)
def test_settings_of_a_render(settings: dict[str, Any], folder: Path) -> None:
    compare_double(small(worlds.room()), folder, **settings)


def test_depth_of_field_at_a_scale_that_does_not_divide_the_width(folder: Path) -> None:
    """Decision 4: the window is f S with S the scale as given."""
    lens = {"focus": 4.0, "depth_range": 9.0, "samples": 5}
    table = worlds.room()
    compare_double(table | {"camera": table["camera"] | {"depth_of_field": lens}}, folder, scale=0.33)


@pytest.mark.parametrize("crop", [(0, 0, 5, 4), (6, 5, 11, 12)])
def test_depth_of_field_of_a_crop_is_that_of_the_picture(
    crop: tuple[int, int, int, int], folder: Path
) -> None:
    scene = tracer.load(small(worlds.FEATURES["depth of field"]()), base_dir=folder)
    x0, y0, x1, y1 = crop
    whole = tracer.render(scene).color
    assert np.array_equal(tracer.render(scene, crop=crop).color, whole[y0:y1, x0:x1])
