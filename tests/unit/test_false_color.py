"""Layers as colors: maps, ranges, blank pixels, and the legend."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tracer.aovs import NAMES
from tracer.color import encode_srgb, quantize
from tracer.film.false_color import BLANK, MAPS, color_map, false_color, id_colors, pictures_of, scales_of
from tracer.film.layout import COMPONENTS, IDS
from tracer.film.legend import with_legend


def row(*values: Any) -> Any:
    return np.array([values])


def test_every_layer_has_a_picture() -> None:
    rng = np.random.default_rng(0)
    for name in ("depth", "z", *NAMES):
        components = COMPONENTS.get(name)
        values = rng.uniform(0, 9, (6, 8, len(components)) if components else (6, 8))
        values = values.astype(np.int32) if name in IDS else values
        image = false_color(name, values)
        assert (image.shape, image.dtype) == ((6, 8, 3), np.uint8), name
        assert np.array_equal(image, false_color(name, values)), name
        assert not (image == BLANK).all(axis=2).any(), name


def test_numbers_go_through_their_map_from_the_smallest_to_the_largest() -> None:
    colors = color_map("depth")
    assert colors[0].tolist() == [68, 1, 84] and colors[255].tolist() == [253, 231, 37], "viridis"
    image = false_color("depth", row(-1.0, 2, 3, 4))
    assert np.array_equal(image[0], [BLANK, colors[0], colors[128], colors[255]])
    assert np.array_equal(false_color("z", row(np.inf, 5, 5))[0], [BLANK, colors[0], colors[0]])
    assert np.array_equal(false_color("rays", row(4, 8))[0], color_map("rays")[[0, 255]])
    assert np.array_equal(
        false_color("visibility.light3", row(0.5, np.nan))[0], [color_map("visibility")[128], BLANK]
    )
    for name in MAPS:
        assert not (color_map(name) == BLANK).all(axis=1).any(), name


def test_a_far_horizon_makes_distances_logarithmic() -> None:
    values = row(*np.linspace(10, 20, 50), 1e5)
    (scale,) = scales_of("depth", values)
    assert scale.logarithmic and (scale.low, scale.high) == (10, 1e5)
    assert scale.place(row(10, 100, 1e3, 1e4, 1e5)) == pytest.approx(row(0, 0, 1 / 3, 2 / 3, 1))
    assert not scales_of("depth", values[:, :50])[0].logarithmic
    assert not scales_of("rays", values)[0].logarithmic


def test_directions_positions_and_light() -> None:
    normals = row([1.0, 0, 0], [0, -1.0, 0], [np.nan] * 3)
    assert false_color("normal", normals).tolist() == [[[255, 128, 128], [128, 0, 128], list(BLANK)]]
    places = row([0.0, 5, 7], [10, 6, 7])
    assert false_color("position", places).tolist() == [[[0, 0, 0], [255, 255, 0]]]
    assert false_color("uv", row([3.0, 9], [4, 1])).tolist() == [[[0, 255, 0], [255, 0, 0]]]
    light = row([0.0, 0.5, 1.7])
    assert np.array_equal(false_color("diffuse", light), quantize(light))
    assert np.array_equal(false_color("diffuse", light, linear=True), quantize(encode_srgb(light)))


def test_colors_of_ids_are_distinct_and_their_own() -> None:
    colors = id_colors(np.arange(4096)).astype(int)
    assert np.array_equal(id_colors(np.arange(7)), colors[:7]), "however many there are"
    few = colors[:64]
    apart = np.abs(few[:, None] - few[None]).sum(axis=2) + 999 * np.eye(64, dtype=int)
    assert apart.min() >= 12, "the first ones can all be told apart"
    assert np.abs(np.diff(colors, axis=0)).sum(axis=1).min() > 90, "neighbors by far"
    assert np.abs(colors - BLANK).max(axis=1).min() > 30
    assert np.array_equal(false_color("shape", row(-1, 3))[0], [BLANK, colors[3]])


def test_nothing_but_blank() -> None:
    for name, values in (("depth", row(-1.0)), ("shape", row(-1)), ("normal", row([np.nan] * 3))):
        assert false_color(name, values).tolist() == [[list(BLANK)]]
        assert scales_of(name, values) == []


def test_visibility_is_a_picture_for_each_light() -> None:
    layers = {"depth": np.zeros((2, 2)), "visibility": np.zeros((2, 2, 3))}
    assert [name for name, _ in pictures_of(layers)] == ["depth", *(f"visibility.light{k}" for k in range(3))]


def test_the_legend_stands_in_the_corner_and_tells_the_range() -> None:
    rng = np.random.default_rng(1)
    for name in ("depth", *NAMES):
        components = COMPONENTS.get(name)
        values = rng.uniform(0, 9, (300, 400, len(components)) if components else (300, 400))
        values = values.astype(np.int32) if name in IDS else values
        image = false_color(name, values)
        drawn = with_legend(image, name, values)
        changed = (drawn != image).any(axis=2)
        assert changed[-1, 0] and not changed[:150].any() and not changed[:, 250:].any(), name
        again = with_legend(image, name, values * 2)
        has_fixed_range = name in ("normal", "Ng", "visibility")
        assert np.array_equal(again, drawn) == has_fixed_range, name
        small = image[:20, :20]
        assert with_legend(small, name, values[:20, :20]) is small, name
