"""Every layer against `reference.plain_layers`, in double precision, pixel by pixel."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tracer
from reference import plain, plain_layers
from reference.tolerances import TOLERANCES
from tests.accuracy import worlds
from tests.accuracy.test_against_plain import small
from tracer.color import decode_srgb

QUICK = ("glasses", "disk jitter", "transparent shadows", "weight zero", "no lights", "picture xy")
WHOLE = ("shape", "primitive", "level", "rays")
IN_SPACE = ("position", "uv")
ALL = ("normal", "Ng", *WHOLE, *IN_SPACE, "visibility", *plain_layers.PARTS)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return worlds.write_files(tmp_path_factory.mktemp("worlds"))


def compare(table: dict[str, Any], folder: Path, **settings: Any) -> dict[str, np.ndarray]:
    result = tracer.render(tracer.load(table, base_dir=folder), precision="double", aovs="all", **settings)
    theirs = plain_layers.layers(plain.load(table, folder), **settings)
    asked = {"depth", *ALL} - (set() if table.get("lights") else {"visibility"})
    assert set(result.aovs) == asked, "all layers are there, without lights all but the visibility"
    for name in sorted(asked - {"depth"}):
        mine, other = result.aovs[name].astype(np.float64), theirs[name]
        assert mine.shape == other.shape, name
        assert np.array_equal(np.isnan(mine), np.isnan(other)), f"{name}: blank elsewhere"
        bound = 0.0 if name in WHOLE else TOLERANCES["color, double"].value
        if name in IN_SPACE:
            bound *= np.nanmax(np.abs(other), initial=1)
        difference = np.nan_to_num(np.abs(mine - other))
        assert difference.max() <= bound, (
            f"{name} differs by {difference.max()} in {(difference > bound).sum()}"
        )
    adds_up(result)
    assert int(result.aovs["rays"].sum()) == sum(result.stats["rays"].values())
    return theirs


def adds_up(result: tracer.Result) -> None:
    """The parts are the color before it was encoded."""
    parts = sum(result.aovs[name].astype(np.float64) for name in plain_layers.PARTS)
    color = decode_srgb(result.color) if result.color_space == "linear" else result.color
    bound = 1e-12 if result.precision == "double" else 4e-6
    assert np.abs(parts - color).max() <= bound * max(1, np.abs(color).max())


@pytest.mark.parametrize("name", QUICK)
def test_layers(name: str, folder: Path) -> None:
    compare(small(worlds.FEATURES[name]()), folder)


def test_layers_of_several_sub_rays(folder: Path) -> None:
    """Visibility is a mean over those that hit; at the border of a mesh in the void others do not."""
    theirs = compare(small(worlds.FEATURES["flat meshes"]()), folder, supersample=2)
    seen = theirs["visibility"]
    assert np.any((seen > 0) & (seen < 1)), "no pixel is lit in part: the scene tests no mean"


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(worlds.FEATURES) - {"depth of field", "depth of field, near"}))
def test_layers_of_every_feature(name: str, folder: Path) -> None:
    compare(small(worlds.FEATURES[name]()), folder)


@pytest.mark.parametrize("name", ["classic", "option_linear", "light_disk"])
@pytest.mark.parametrize("precision", ["single", "double"])
def test_layers_change_no_pixel_and_add_up(name: str, precision: str) -> None:
    settings: dict[str, Any] = {"scale": 0.05, "precision": precision, "supersample": 2}
    scene = tracer.load(name)
    result = tracer.render(scene, aovs="all", **settings)
    assert np.array_equal(result.color, tracer.render(scene, **settings).color)
    adds_up(result)
