"""How the viewer's camera moves: around a point that keeps its place, and as the document moves it."""

from __future__ import annotations

import numpy as np
import pytest

from tracer.camera import Camera
from tracer.canvas import Canvas
from tracer.scene.toml_files import parse_toml
from tracer.viewer.camera import as_toml, dollied, orbited, panned, pivot_of, rotated, shifted

CANVAS = Camera(distance=800.0, position=(10.0, 20.0, 30.0), rotate=(15.0, -12.0), resolution=(640, 480))
LOOK_AT = Camera(origin=(3.0, 2.0, 6.0), target=(0.0, 1.0, 0.0), fov=40.0, resolution=(640, 480))
BOTH = pytest.mark.parametrize("camera", [CANVAS, LOOK_AT], ids=["canvas", "look-at"])


def seen(camera: Camera, point: np.ndarray) -> np.ndarray:
    """Where a point is in the picture, in shares of its height from the middle, right and down."""
    canvas = Canvas.of(camera)
    arm = point - canvas.eye
    share = canvas.distance / (arm @ canvas.forward) / canvas.pixel_size / canvas.height
    return np.array([arm @ canvas.x, arm @ canvas.y]) * share


def distance(camera: Camera, point: np.ndarray) -> float:
    return float(np.linalg.norm(Canvas.of(camera).eye - point))


@BOTH
def test_an_orbit_keeps_its_pivot_and_the_distance_to_it(camera: Camera) -> None:
    pivot = pivot_of(camera, 400.0)
    moved = orbited(camera, pivot, 30.0, -10.0)
    assert moved != camera
    assert seen(moved, pivot) == pytest.approx([0, 0], abs=1e-9)
    assert distance(moved, pivot) == pytest.approx(distance(camera, pivot))
    back = orbited(orbited(moved, pivot, -30.0, 0.0), pivot, 0.0, 10.0)
    assert Canvas.of(back).eye == pytest.approx(Canvas.of(camera).eye, abs=1e-6)


@BOTH
def test_an_orbit_to_the_left_turns_the_view_to_the_left(camera: Camera) -> None:
    """As x_rotate: positive is left and up."""
    pivot = pivot_of(camera, 400.0)
    before = Canvas.of(camera)
    left, up = (Canvas.of(orbited(camera, pivot, *by)).forward for by in ((5.0, 0.0), (0.0, 5.0)))
    assert left @ before.x < 0 and up @ before.y < 0


@BOTH
def test_an_orbit_never_goes_over_the_top(camera: Camera) -> None:
    pivot = pivot_of(camera, 400.0)
    for up in (500.0, -500.0):
        steep = orbited(camera, pivot, 0.0, up)
        assert abs(Canvas.of(steep).forward[1]) == pytest.approx(np.sin(np.radians(89.0)))
        assert Canvas.of(steep).y[1] < 0


@BOTH
def test_a_pan_moves_the_pivot_with_the_mouse(camera: Camera) -> None:
    pivot = pivot_of(camera, 400.0)
    assert seen(panned(camera, pivot, 0.25, -0.1), pivot) == pytest.approx([0.25, -0.1], abs=1e-9)


@BOTH
def test_a_dolly_goes_a_share_of_the_way(camera: Camera) -> None:
    pivot = pivot_of(camera, 400.0)
    assert distance(dollied(camera, pivot, 0.25), pivot) == pytest.approx(0.75 * distance(camera, pivot))
    assert distance(dollied(camera, pivot, -0.5), pivot) == pytest.approx(1.5 * distance(camera, pivot))
    assert distance(dollied(camera, pivot, 7.0), pivot) > 0


def test_the_documents_moves_add_to_the_keys_of_the_scene_file() -> None:
    moved = shifted(rotated(CANVAS, 20.0, 5.0), (1.0, 2.0, 3.0))
    assert moved.rotate == (35.0, -7.0) and moved.position == (11.0, 22.0, 33.0)


def test_a_look_at_camera_rotates_about_the_canvas_center_too() -> None:
    before, after = Canvas.of(LOOK_AT), Canvas.of(rotated(LOOK_AT, 20.0, 5.0))
    assert after.center == pytest.approx(before.center)
    cos, sin = np.cos(np.radians(20)), np.sin(np.radians(20))
    flat = Canvas.of(rotated(LOOK_AT, 20.0, 0.0))
    assert flat.forward == pytest.approx(cos * before.forward - sin * before.x)
    assert after.forward @ flat.y < 0


@BOTH
def test_the_text_is_the_table_of_the_scene_file(camera: Camera) -> None:
    camera = camera.model_copy(update={"depth_of_field": None})
    assert Camera(**parse_toml(as_toml(camera), "text")["camera"]) == camera


def test_the_text_has_the_depth_of_field() -> None:
    camera = Camera(depth_of_field={"focus": 900.0, "samples": 8})  # type: ignore[arg-type]
    assert Camera(**parse_toml(as_toml(camera), "text")["camera"]) == camera
