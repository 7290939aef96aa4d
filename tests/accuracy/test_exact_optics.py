"""What must hold exactly, or to a derived bound: glass of index 1, white in white light, a scene far from
the origin."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import tracer
from reference.tolerances import EPSILON, TOLERANCES
from tests.accuracy import worlds
from tests.accuracy.probe import directions


@pytest.mark.parametrize("precision", ["single", "double"])
def test_glass_of_index_one_keeps_directions_bit_for_bit(precision: str) -> None:
    air = {"ior": 1.0, "refraction": 1.0}
    block = worlds.cube(material="air", rotate=[10.0, 20.0, 30.0])
    ball = {"kind": "sphere", "center": [0.3, 0.2, 0.1], "radius": 2.3, "material": "air"}
    wall = {"kind": "plane", "coefficients": [1, 2, 3, 9], "material": "air"}
    scene = tracer.load({"materials": {"air": air}, "shapes": [block, ball, wall]})
    rng = np.random.default_rng(1)
    o, d = 6 * directions(rng, 5000), directions(rng, 5000)
    path = tracer.trace_path(scene, o, d, "TTTTT", precision=precision)
    start = tracer.trace_path(scene, o, d, "T", precision=precision).direction[:, 0]
    assert path.count.max() == 5
    for vertex in range(5):
        reached = path.count > vertex
        assert np.array_equal(path.direction[reached, vertex], start[reached])


def test_air_changes_no_pixel() -> None:
    """A shape of glass of index 1 that lets everything through leaves depth aside and colors as they were."""
    air = {"ior": 1.0, "refraction": 1.0, "diffuse": 0.0}
    table = worlds.room(ambient=0.0, materials=worlds.MATERIALS | {"nothing": air}, transparent_shadows=True)
    wall = {"kind": "plane", "coefficients": [0.3, 0.2, 1, -4.9], "material": "nothing"}
    bare = tracer.render(tracer.load(table), precision="double").color
    clear = tracer.render(tracer.load(table | {"shapes": [*table["shapes"], wall]}), precision="double").color
    assert np.abs(clear - bare).max() < TOLERANCES["color, double"].value


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("seed", range(4))
def test_white_never_exceeds_one(precision: str, seed: int) -> None:
    """Everything white with m + h <= 1 under white lights: no color above 1 by more than 4 ulp."""
    rng = np.random.default_rng(seed)
    share, m = rng.uniform(0, 1), rng.uniform(0, 1)
    white = {
        "ior": 1.3,
        "reflection": share * 0.6,
        "refraction": (1 - share) * 0.4,
        "diffuse": m,
        "specular": 1 - m,
    }
    table = worlds.room(ambient=float(rng.uniform(0, 1)), background=[1, 1, 1], secondary_background=True)
    table["lights"] = [
        {"kind": "point", "position": rng.uniform(-3, 9, 3).tolist(), "weight": float(rng.uniform(0.1, 3))}
        for _ in range(7)
    ]
    table["lights"] += [{"kind": "point", "position": table["camera"]["position"], "weight": 900.0}]
    table["materials"] = dict.fromkeys(worlds.MATERIALS, white | {"shininess": float(rng.choice([0, 1, 3]))})
    for shape in table["shapes"]:
        shape.pop("texture", None)
        shape["color"] = "#ffffff"
    result = tracer.render(tracer.load(table), precision=precision)
    ulp = 2 * EPSILON[precision]
    assert result.color.max() <= 1 + TOLERANCES["white"].value * ulp
    assert result.color.max() > 0.5


def solid_room(shift: float) -> dict[str, Any]:
    """A room of solid colors without mirrors, moved along x, y and z."""
    move = np.full(3, shift)
    table = worlds.room(lights=[])
    table["lights"] = [
        light | {"position": (np.array(light["position"]) + move).tolist()} for light in worlds.POINT_LIGHTS
    ]
    shapes = [
        {"kind": "plane", "coefficients": [0, 1, 0, 0], "color": "#a0b0c0"},
        {"kind": "sphere", "center": [-2.3, 1.6, -1.7], "radius": 1.5, "color": "#70ff70"},
        worlds.cube(translate=[3.7, 1.33, -2.9], rotate=[12.0, 33.0, 5.0], color="#ff8070"),
    ]
    for shape in shapes:
        shape["translate"] = (np.array(shape.get("translate", [0, 0, 0])) + move).tolist()
    camera = table["camera"] | {"position": (np.array(table["camera"]["position"]) + move).tolist()}
    return table | {"shapes": shapes, "camera": camera}


def test_moved_scene_keeps_its_colors() -> None:
    """Moved by 2,000 units: the picture changes by less than the bound, except at edges, which are counted.

    Every coordinate is rounded to eps (S + 2000), so normals, directions to lights and cosines change by
    that over the smallest length in play, here the radius 1.5; see the table of tolerances.
    """
    here = tracer.render(tracer.load(solid_room(0.0)), precision="single")
    there = tracer.render(tracer.load(solid_room(2000.0)), precision="single")
    difference = np.abs(here.color.astype(float) - there.color).max(axis=2)
    limit = TOLERANCES["moved"].value * EPSILON["single"] * 2012 / 1.5
    edges = difference > limit
    assert edges.mean() <= 0.02, f"{edges.sum()} pixels differ by more than {limit}: up to {difference.max()}"
    assert difference.max() > 0
