"""The tree of rays of a pixel adds up to the rendered pixel, and has the rays that a render counts."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tracer
from reference import plain
from tests.accuracy import worlds

QUICK = ("glasses", "disk jitter", "transparent shadows", "flat meshes")
PIXELS = ((3, 3), (8, 6), (11, 9))
SMALL = {"resolution": (16, 12)}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return worlds.write_files(tmp_path_factory.mktemp("worlds"))


def check(scene: tracer.Scene, x: int, y: int, **settings: Any) -> tracer.PixelTree:
    """Color and counts of the tree against those of the render of this one pixel."""
    scene.camera.depth_of_field = None
    tree = tracer.pixel_tree(scene, x, y, **settings)
    pixel = tracer.render(scene, crop=(x, y, x + 1, y + 1), **settings)
    rounding = 2e-6 if tree.precision == "single" else 1e-14
    assert np.abs(tree.color - pixel.color[0, 0]).max() <= rounding * max(1, pixel.color.max())
    kinds = Counter(ray.kind for ray in tree.rays())
    shadow = sum(light.facing for ray in tree.rays() for light in ray.lights)
    assert {"shadow": shadow, **kinds} == {
        kind: count for kind, count in pixel.stats["rays"].items() if count or kind == "shadow"
    }
    ends = Counter(child.reason for ray in tree.rays() for child in ray.ended)
    assert ends["cut off"] == pixel.stats["ended_by_cutoff"]
    assert ends["too deep"] == pixel.stats["ended_by_depth"]
    return tree


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("name", QUICK)
def test_the_tree_adds_up(name: str, precision: str, folder: Path) -> None:
    scene = tracer.load(worlds.FEATURES[name](), base_dir=folder)
    for x, y in PIXELS:
        check(scene, x, y, precision=precision, supersample=2, **SMALL)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(worlds.FEATURES))
def test_the_tree_of_every_feature_adds_up(name: str, folder: Path) -> None:
    scene = tracer.load(worlds.FEATURES[name](), base_dir=folder)
    for x, y in PIXELS:
        check(scene, x, y, precision="double", **SMALL)
        check(scene, x, y, precision="single", supersample=2, **SMALL)


@pytest.mark.parametrize("name", ["classic", "optics_total_reflection"])
def test_the_tree_of_built_in_scenes_adds_up(name: str) -> None:
    scene = tracer.load(name)
    width, height = scene.camera.resolution
    for x, y in ((width // 2, height // 2), (width * 11 // 20, height * 11 // 20), (width // 3, height // 4)):
        check(scene, x, y, supersample=1)


def test_the_tree_is_that_of_the_second_version(folder: Path) -> None:
    """Ray by ray: kind, weight, hit, color and light."""
    table = worlds.FEATURES["glasses"]()
    scene = tracer.load(table, base_dir=folder)
    most = 0
    for x, y in ((16, 12), (10, 14), (22, 12), (12, 8)):
        tree = tracer.pixel_tree(scene, x, y, precision="double", supersample=1)
        most = max(most, compare(tree.sub_rays[0], plain.ray_tree(plain.load(table, folder), x, y, n=1)))
    assert most > 5, "no pixel has a tree worth the name"


def compare(mine: tracer.RayNode, theirs: plain.Node) -> int:
    """Asserts that two trees are one, and gives the number of their rays."""
    assert (mine.kind, mine.level) == (theirs.kind, theirs.level)
    assert np.allclose([mine.weight, mine.factor], [theirs.weight, theirs.factor], rtol=1e-14)
    assert np.allclose([mine.origin, mine.direction], [theirs.origin, theirs.direction], atol=1e-10)
    assert (mine.hit is None) == (theirs.shape < 0)
    if mine.hit is not None:
        assert (mine.hit.shape, mine.hit.primitive) == (theirs.shape, theirs.primitive)
        assert np.isclose(mine.hit.t, theirs.t, rtol=1e-10)
        assert np.allclose(mine.hit.color, theirs.surface_color, atol=1e-12)
        for term, sum_ in (("diffuse", theirs.diffuse_light), ("specular", theirs.specular_light)):
            total = np.sum([np.zeros(3), *(getattr(light, term) for light in mine.lights)], axis=0)
            assert np.allclose(total, sum_, atol=1e-10)
    assert len(mine.children) == len(theirs.children)
    return 1 + sum(compare(a, b) for a, b in zip(mine.children, theirs.children, strict=True))


def test_what_hides_a_light_is_named() -> None:
    """A small light above two spheres: below them the nearer one is named, in the open nobody."""
    ball = {"kind": "sphere", "radius": 1}
    scene = tracer.load(
        {
            "camera": {"origin": [0, 3, 9], "target": [0, -1, 0], "fov": 60, "resolution": [9, 9]},
            "lights": [{"kind": "point", "position": [0, 90, 0]}],
            "shapes": [
                {"kind": "plane", "coefficients": [0, 1, 0, 1], "name": "floor"},
                ball | {"center": [0, 60, 0], "name": "far"},
                ball | {"center": [0, 30, 0], "name": "near"},
            ],
        }
    )
    below, beside = (tracer.pixel_tree(scene, x, y).sub_rays[0].lights[0] for x, y in ((4, 4), (8, 8)))
    assert below.hidden_by == (("near", 1),)
    assert (below.share, beside.share, beside.hidden_by) == (0, 1, ())


def test_the_tree_as_json(folder: Path) -> None:
    scene = tracer.load(worlds.FEATURES["glasses"](), base_dir=folder)
    tree = tracer.pixel_tree(scene, 16, 12, supersample=1)
    read = json.loads(json.dumps(tree.to_dict()))
    assert read["color"] == tree.color.tolist()
    assert read["sub_rays"][0]["hit"]["name"] == tree.sub_rays[0].hit.name


def test_a_pixel_outside_is_refused() -> None:
    with pytest.raises(tracer.UsageError, match="0 <= X < 1280 and 0 <= Y < 960"):
        tracer.pixel_tree(tracer.load("classic"), 1280, 3)
