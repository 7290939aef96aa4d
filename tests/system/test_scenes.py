"""The scenes that come with the renderer: they load, explain themselves and render; so do their pictures."""

from __future__ import annotations

import itertools
import math
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

import tracer
from tracer.assets import builtin_scenes
from tracer.cli.app import cli
from tracer.scene_warnings import finite_extents, warnings_of
from tracer.shapes import Plane, Sphere

SCENES = builtin_scenes()
WALLPAPERS = ["fox.png", "forest.png", "marble.png"]
ROOMS = [name for name in SCENES if name == "room" or name.startswith("classic")]
every_scene = pytest.mark.parametrize("name", SCENES)
every_room = pytest.mark.parametrize("name", ROOMS)


def picture_of(path: Path) -> np.ndarray:
    """The stored values of a PNG file."""
    picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert picture is not None, f"{path} is not a picture"
    return picture


@every_scene
def test_opens_with_a_comment_that_says_what_is_known(name: str) -> None:
    lines = SCENES[name].read_text(encoding="utf-8").splitlines()
    comment = list(itertools.takewhile(lambda line: line.startswith("#"), lines))
    assert comment[0].endswith(".")
    assert any("nown in closed form:" in line for line in comment)


@every_room
def test_renders_without_warnings(name: str) -> None:
    scene = tracer.load(SCENES[name])
    assert warnings_of(scene) == []
    result = tracer.render(scene, scale=0.1, supersample=1)
    assert result.color.std() > 0.1
    assert result.depth.min() > 0, "these rooms are closed towards the view: no pixel is blank"
    assert result.stats["ended_by_depth"] == 0


@every_scene
def test_info_describes_it(name: str) -> None:
    done = CliRunner().invoke(cli, ["info", name])
    assert done.exit_code == 0, done.output
    assert f"scene       {name} (" in done.output
    assert "warning" not in done.output


@pytest.mark.parametrize("name", [name for name in ROOMS if name != "room"])
def test_shapes_and_lights_have_names_of_their_own(name: str) -> None:
    scene = tracer.load(SCENES[name])
    names = [entry.name for entry in (*scene.shapes, *scene.lights)]
    assert all(names)
    assert len(set(names)) == len(names)


def test_the_focus_is_the_front_of_the_green_ball() -> None:
    scene = tracer.load(SCENES["classic_focus"])
    assert scene.camera.depth_of_field is not None and scene.camera.distance is not None
    ball = next(shape for shape in scene.shapes if shape.name == "green ball")
    assert isinstance(ball, Sphere)
    tilt = math.radians(scene.camera.rotate[1])
    forward = np.array([0.0, math.sin(tilt), -math.cos(tilt)])
    eye = np.array(scene.camera.position) - scene.camera.distance * forward
    away = np.array(ball.center) - eye
    distance = np.linalg.norm(away)
    front = distance - ball.radius - scene.camera.distance * distance / (away @ forward)
    assert scene.camera.depth_of_field.focus == pytest.approx(front, rel=0.01)


def test_the_wallpaper_stands_upright(repository: Path) -> None:
    """One texel a unit, the file's last row on the floor: seen straight on, evenly lit, it is the file."""
    picture = picture_of(repository / "assets" / "forest.png")
    height, width = picture.shape[:2]
    scene = tracer.load(
        SCENES["classic"],
        overrides={
            "ambient": 1.0,
            "camera.resolution": [width, height],
            "camera.supersample": 1,
            "camera.distance": 1e9,
            "camera.rotate": [0.0, 0.0],
            "camera.position": [width / 2, height / 2, -1199.5],
        },
    )
    color = tracer.render(scene, precision="double").color
    np.testing.assert_array_equal(np.floor(255 * color + 0.5), picture[:, :, ::-1])


def test_the_ceiling_cuts_no_tree(repository: Path) -> None:
    """The rows of the wallpaper at the ceiling's height lie between two lines of trees: they are plain."""
    picture = picture_of(repository / "assets" / "forest.png")
    ceiling = next(shape for shape in tracer.load(SCENES["classic"]).shapes if shape.name == "ceiling")
    assert isinstance(ceiling, Plane)
    highest = math.ceil(ceiling.placed_coefficients()[3]) - 1
    row = len(picture) - 1 - highest % len(picture)
    assert row == 210
    assert len(np.unique(picture[row - 2 : row + 3].reshape(-1, 3), axis=0)) == 1


def test_how_far_things_in_the_classic_room_are_from_what_carries_them() -> None:
    scene = tracer.load(SCENES["classic"])
    lowest, highest = {}, {}
    for number, (points, radius) in finite_extents(scene).items():
        name = scene.shapes[number].name
        lowest[name] = (points[:, 1] - radius).min()
        highest[name] = (points[:, 1] + radius).max()
    assert lowest.pop("tetrahedron") == pytest.approx(63.6 - 110 / math.sqrt(3), abs=1e-4)
    assert lowest.pop("cube") == pytest.approx(0.1, abs=1e-4)
    assert lowest.pop("golden ball") - highest["cube"] == pytest.approx(0.1, abs=1e-4)
    assert len(lowest) == 5
    assert set(lowest.values()) == {0.0}


@pytest.mark.parametrize("name", WALLPAPERS)
def test_wallpapers_tile(name: str, repository: Path) -> None:
    """Across the seam neighbors differ no more than they do at the busiest place inside."""
    picture = picture_of(repository / "assets" / name).astype(float)
    for axis in (0, 1):
        steps = np.abs(np.diff(picture, axis=axis, append=picture.take([0], axis=axis)))
        across = steps.mean(axis=(1 - axis, 2))
        assert across[-1] <= across[:-1].max()


@pytest.mark.slow
def test_wallpapers_are_what_the_program_draws(repository: Path, tmp_path: Path) -> None:
    program = repository / "assets" / "make_wallpapers.py"
    subprocess.run([sys.executable, str(program), str(tmp_path)], check=True, timeout=120)
    for name in WALLPAPERS:
        kept = repository / "assets" / name
        assert kept.stat().st_size < 300_000
        np.testing.assert_array_equal(picture_of(tmp_path / name), picture_of(kept), err_msg=name)
