"""The small scenes, one a feature: what their opening comments state in closed form, and that none is
missing."""

from __future__ import annotations

import math

import drjit as dr
import numpy as np
import pytest

import tracer
from tracer.assets import builtin_scenes
from tracer.color import decode_srgb, encode_srgb
from tracer.lights import LIGHT_KINDS
from tracer.scene_warnings import warnings_of
from tracer.shapes import SHAPE_KINDS
from tracer.textures import TEXTURE_KINDS


def test_every_kind_and_every_option_has_a_scene() -> None:
    """Walks the registries and the switches of the model: a new one needs a scene that shows it."""
    scenes = [tracer.load(name) for name in builtin_scenes()]
    assert {shape.kind for scene in scenes for shape in scene.shapes} == set(SHAPE_KINDS)
    assert {light.kind for scene in scenes for light in scene.lights} == set(LIGHT_KINDS)
    assert {texture.kind for scene in scenes for texture in scene.textures.values()} == set(TEXTURE_KINDS)
    for key in ("literal", "secondary_background", "transparent_shadows"):
        assert any(getattr(scene, key) for scene in scenes), key
    assert {scene.tir for scene in scenes} == {"drop", "reflect"}
    assert {scene.color_space for scene in scenes} == {"display", "linear"}
    assert {scene.diffuse_term for scene in scenes} == {"lambert", "reflection"}
    assert {scene.camera.is_look_at for scene in scenes} == {True, False}
    assert any(scene.camera.depth_of_field for scene in scenes)
    assert any(getattr(light, "jitter", False) for scene in scenes for light in scene.lights)
    assert any(shape.texture_space == "object" for scene in scenes for shape in scene.shapes)
    assert any(getattr(shape, "smooth", False) for scene in scenes for shape in scene.shapes)


@pytest.mark.parametrize("name", [name for name in builtin_scenes() if "_" in name])
def test_renders(name: str) -> None:
    """Finite colors, no warnings, and something to see."""
    scene = tracer.load(name)
    result = tracer.render(scene, scale=0.2, supersample=1)
    assert warnings_of(scene) == []
    assert np.isfinite(result.color).all() and (result.depth > 0).any()


def test_sphere_outline() -> None:
    """The outline is a circle of angular radius asin(1/5): it covers pi (tan(asin(1/5)) / tan(15 deg))^2 / 4
    of the square of the picture's height."""
    result = tracer.render(tracer.load("shape_sphere"), supersample=4)
    height = result.alpha.shape[0]
    radius = math.tan(math.asin(1 / 5)) / math.tan(math.radians(15)) * height / 2
    # The sum of coverages misses the area by the outline's length times the grid's step, at most.
    assert result.alpha.sum() == pytest.approx(math.pi * radius**2, abs=2 * math.pi * radius / 4)
    assert np.min(result.depth[result.depth > 0]) + 5e-3 == pytest.approx(4, abs=1e-4)


def test_horizon_of_the_plane() -> None:
    """A ray that falls by the angle a hits 2/sin(a) from the eye; above the horizon there is nothing."""
    scene = tracer.load("shape_plane")
    result = tracer.render(scene, precision="double", supersample=1)
    rows, columns = result.depth.shape
    assert (result.depth[: rows // 2] == -1).all()
    step = 2 * math.tan(math.radians(20)) / rows  # of the canvas at distance 1
    y, x = (np.arange(rows) + 0.5 - rows / 2) * step, (np.arange(columns) + 0.5 - columns / 2) * step
    sine = y[:, None] / np.sqrt(1 + y[:, None] ** 2 + x**2)
    canvas = 7e-3 * np.sqrt(1 + y[:, None] ** 2 + x**2)
    below = slice(rows // 2, None)
    np.testing.assert_allclose(result.depth[below], (2 / sine - canvas)[below], rtol=1e-10)


def test_furnace_is_exactly_white() -> None:
    """White surfaces in ambient light 1 under a white sky: 1 everywhere, but for the weighing of sub-rays."""
    color = tracer.render(tracer.load("optics_furnace")).color
    assert np.abs(color - 1).max() <= 4 * 2.0**-24


def test_mirror_box_ends_by_depth() -> None:
    """Perfect mirrors never lose weight: every path that meets no ball ends by the cap of 16."""
    stats = tracer.render(tracer.load("optics_mirror_box"), supersample=1).stats
    assert stats["deepest_level"] == 16
    assert stats["ended_by_depth"] > 0 and stats["ended_by_cutoff"] == 0


def test_window_of_total_reflection() -> None:
    """Rays steeper than asin(1/1.333) from the vertical leave the water, all others are mirrored."""
    scene = tracer.load("optics_total_reflection")
    angles = np.radians(np.concatenate([np.linspace(0, 48.5, 50), np.linspace(48.7, 89, 50)]))
    d = np.stack([np.sin(angles), np.cos(angles), np.zeros_like(angles)], axis=1)
    path = tracer.trace_path(scene, np.tile([0.0, -3.0, 0.0], (100, 1)), d, "T")
    total = np.isnan(path.direction[:, 0, 0])
    assert not total[:50].any() and total[50:].all()
    out = path.direction[:50, 0]
    np.testing.assert_allclose(out[:, 0], 1.333 * np.sin(angles[:50]), atol=1e-14)


def test_ring_gives_25_visibilities() -> None:
    """24 samples of one weight: below the light the floor's brightness takes steps of 1/24."""
    scene = tracer.load("light_ring")
    assert len(scene.lights) == 1
    result = tracer.render(scene, supersample=1, precision="double")
    darkest = result.color[result.depth > 0][:, 0].min()
    assert darkest == pytest.approx(0.2 * 0xC0 / 255, rel=1e-12)  # the ball's shade: the ambient share


def test_transparent_shadows_of_ball_and_pane() -> None:
    """Straight through the ball's middle: k_t^2 = 0.49 of the light; through the pane: 0.7."""
    scene = tracer.load("option_transparent_shadows")
    light = np.array([0.0, 6.0, 2.0])
    for inside, share in ((np.array([-0.9, 0.9, 0.0]), 0.49), (np.array([1.0, 0.9, 0.0]), 0.7)):
        floor = light + (inside - light) * light[1] / (light[1] - inside[1])
        straight = light - floor
        cosine = straight[1] / np.linalg.norm(straight)
        expected = 0.2 + 0.8 * share * cosine
        # The floor itself, seen from above the spot by a camera that looks down from below the glass.
        view = tracer.load(
            scene.to_dict()
            | {
                "camera": {
                    "resolution": [1, 1],
                    "origin": [floor[0], 0.1, floor[2]],
                    "target": floor.tolist(),
                    "up": [0, 0, 1],
                    "fov": 0.01,
                }
            }
        )
        color = tracer.render(view, precision="double").color[0, 0, 0]
        assert color / (0xD8 / 255) == pytest.approx(expected, rel=1e-6)


def test_linear_ambient_share() -> None:
    """In the shade the floor is encode(0.2 decode(color))."""
    scene = tracer.load("option_linear")
    scene.lights[0].position = (4.0, -6.0, 5.0)
    color = tracer.render(scene, supersample=1, precision="double").color[-1, 0]
    floor = np.array([0xD8, 0xD4, 0xC8]) / 255
    np.testing.assert_allclose(color, encode_srgb(0.2 * decode_srgb(floor)), rtol=1e-12)


def test_literal_cells_around_zero_are_twice_as_wide() -> None:
    """Rounding towards zero puts -40 < x < 40 into one cell."""
    result = tracer.render(tracer.load("option_literal"))
    row = result.color[60, :, 0] > 0.5
    x = np.arange(320) - 160.0
    changes = np.abs((x * 1.5)[1:][row[1:] != row[:-1]])  # the wall is half as far again as the canvas
    expected = [40, 40, 80, 80, 120, 120, 160, 160, 200, 200]
    np.testing.assert_allclose(np.sort(changes[changes < 230]), expected, atol=2)


@pytest.mark.parametrize("width", [1, 7, 1000])
@pytest.mark.parametrize("precision", ["single", "double"])
def test_queries_of_every_width(width: int, precision: str) -> None:
    """The answer of a ray does not depend on how many others are asked."""
    scene = tracer.load("shape_mesh")
    rng = np.random.default_rng(7)
    o = rng.uniform(-3, 3, (1000, 3)) + [0, 3, 4]
    d = rng.normal(size=(1000, 3))
    whole = tracer.intersect(scene, o, d, precision=precision)
    part = tracer.intersect(scene, o[:width], d[:width], precision=precision)
    for name in ("t", "shape", "primitive", "normal", "position"):
        np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[:width])
    path = tracer.trace_path(scene, o[:width], d[:width], "RR", precision=precision)
    assert path.position.shape == (width, 2, 3)


@pytest.mark.slow
def test_debug_mode_finds_no_access_out_of_bounds() -> None:
    """Dr.Jit's Debug flag checks every gather and scatter; a picture of meshes, textures and area lights."""
    with dr.scoped_set_flag(dr.JitFlag.Debug):
        checked = tracer.render(tracer.load("classic_rabbit"), scale=0.05, supersample=1)
    plain = tracer.render(tracer.load("classic_rabbit"), scale=0.05, supersample=1)
    np.testing.assert_allclose(checked.color, plain.color, atol=1e-5)
