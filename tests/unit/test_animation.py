"""`[[animation]]`: keyed values, what may be keyed, and how each fault is told."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import tracer
from tracer.errors import SceneError
from tracer.scene.animation import Track


def animated(*tracks: dict[str, Any], **top: Any) -> tracer.Scene:
    """A ball and a light, with these tracks."""
    return tracer.load(
        {
            "lights": [{"kind": "disk", "center": [0, 9, 0], "normal": [0, -1, 0], "radius": 1}],
            "materials": {"glass": {"ior": 1.5}},
            "textures": {"wood": {"kind": "affine_image", "file": "assets/fox.png", "matrix": np.eye(2, 3)}},
            "shapes": [{"kind": "sphere", "name": "red ball", "center": [0, 0, -9], "radius": 1}],
            "animation": list(tracks),
            **top,
        }
    )


def track(key: str = "camera.distance", **keys: Any) -> dict[str, Any]:
    return {"key": key, "times": [1, 11], "values": [1, 2], **keys}


@pytest.mark.parametrize(
    ("interpolation", "expected"),
    [
        ("linear", {0: 2, 1: 2, 3: 3, 5: 4, 7: 5, 9: 6, 13: 3, 99: 3}),
        ("constant", {0: 2, 1: 2, 4.99: 2, 5: 4, 8.99: 4, 9: 6, 12: 6, 13: 3, 99: 3}),
        ("smooth", {0: 2, 1: 2, 5: 4, 9: 6, 11: 4.5, 13: 3, 99: 3}),
    ],
)
def test_values_between_keys(interpolation: Any, expected: dict[float, float]) -> None:
    keyed = Track(key="x", times=[1, 5, 9, 13], values=[2, 4, 6, 3], interpolation=interpolation)
    assert {frame: keyed.at(frame) for frame in expected} == pytest.approx(expected)


def test_a_smooth_curve_rests_at_its_ends_and_never_leaves_its_range() -> None:
    keyed = Track(
        key="x",
        times=[0, 1, 2, 10, 11],
        values=[[0, 1], [0, 5], [1, 6], [1, 6.5], [0, 7]],
        interpolation="smooth",
    )
    frames = np.linspace(-1, 12, 2601)
    values = np.array([keyed.at(frame) for frame in frames])
    assert values.min(axis=0).tolist() == [0, 1] and values.max(axis=0).tolist() == [1, 7]
    assert (np.diff(values[:, 1]) >= 0).all(), "increasing values give an increasing curve"
    assert (values[(frames >= 2) & (frames <= 10), 0] == 1).all()
    slopes = np.gradient(values[:, 1], frames)
    assert np.abs(np.diff(slopes)).max() < 0.2, (
        "no kink: a second derivative of at most 24, at steps of 0.005"
    )
    assert abs(slopes[frames.searchsorted(0)]) < 0.1 > abs(slopes[frames.searchsorted(11)])


def test_two_smooth_keys_ease_in_and_out() -> None:
    keyed = Track(key="x", times=[0, 4], values=[0, 1], interpolation="smooth")
    assert [keyed.at(t) for t in range(5)] == pytest.approx([0, 0.15625, 0.5, 0.84375, 1])


@pytest.mark.parametrize(
    ("key", "values", "look", "middle"),
    [
        ("camera.distance", [100, 200], lambda s: s.camera.distance, 150),
        ("camera.rotate", [[0, 0], [90, 10]], lambda s: s.camera.rotate, (45, 5)),
        ("camera.rotate.1", [0, 10], lambda s: s.camera.rotate, (0, 5)),
        ('shapes."red ball".center', [[0, 0, 0], [2, 4, 6]], lambda s: s.shapes[0].center, (1, 2, 3)),
        ("shapes.0.color", ["#ff0000", [0, 0, 1]], lambda s: s.shapes[0].color, (0.5, 0, 0.5)),
        ("lights.0.radius", [1, 3], lambda s: s.lights[0].radius, 2),
        ("materials.glass.ior", [1, 2], lambda s: s.materials["glass"].ior, 1.5),
        ("ambient", [0, 1], lambda s: s.ambient, 0.5),
        ("background", ["#000", "#fff"], lambda s: s.background, (0.5, 0.5, 0.5)),
        ("seed", [0, 4], lambda s: s.seed, 2),
        (
            "textures.wood.matrix",
            [np.eye(2, 3), np.full((2, 3), 3)],
            lambda s: np.array(s.textures["wood"].matrix).tolist(),
            [[2, 1.5, 1.5], [1.5, 2, 1.5]],
        ),
    ],
)
def test_any_number_can_be_keyed(key: str, values: Any, look: Any, middle: Any) -> None:
    scene = animated(
        track(key, values=values),
        camera={"distance": 800},
        shapes=[{"kind": "sphere", "name": "red ball", "center": [0, 0, -9], "radius": 1, "color": "#f00"}],
    )
    before = scene.to_dict()
    still = scene.at(6)
    assert look(still) == middle
    assert still.animation == [] and "animation" not in still.to_dict()
    assert scene.to_dict() == before, "the scene itself does not change"
    assert tracer.load(scene.to_dict()) == scene


STRUCTURE = "is part of the compiled program"


@pytest.mark.parametrize(
    ("tracks", "message"),
    [
        ([track("camera.fovv")], r"`animation.0.key` is \"camera.fovv\", but `fovv` is unknown; .* `fov`"),
        ([track("camera.fov")], "which the scene does not state"),
        ([track("shapes.1.radius")], "there is no entry `1`; .* `red ball`"),
        ([track('shapes."red bal".radius')], "no entry `red bal`; the nearest known name is `red ball`"),
        ([track("tir")], "which is no number, vector or color"),
        ([track("shapes.0.material")], "which the scene does not state"),
        ([track("shapes.0.radius.x")], "there is nothing below a number"),
        ([track("animation.0.times")], "the list is empty"),
        ([track("camera.")], "is no path"),
        ([track("camera distance")], "is no path"),
        ([track("cutoff")], f"cutoff.*{STRUCTURE}"),
        ([track("max_depth")], STRUCTURE),
        ([track("camera.supersample")], STRUCTURE),
        ([track("camera.resolution")], STRUCTURE),
        ([track("lights.0.samples")], STRUCTURE),
        ([track(), track()], r"`animation.1.key` is .*, which `animation.0` keys already"),
        ([track(times=[1, 1])], "`animation.0.times.1` is 1 after 1; allowed: increasing times"),
        ([track(times=[2, 1])], "`animation.0.times.1` is 1 after 2"),
        ([track(times=[], values=[])], "`animation.0.times` has 0 entries"),
        ([track(values=[1])], "`animation.0.values` has 1 entries; allowed: 2"),
        ([track(values=[1, [2]])], "`animation.0.values.1` has another form"),
        ([track(values=[1, -2])], "`animation.0.values.1` cannot be the value .* greater than 0"),
        ([track(values=[1, True])], "`animation.0.values.1` is true; allowed: a number"),
        ([track(values=[1, float("nan")])], "`animation.0.values.1` is nan"),
        ([track(values=["#12", "#fff"])], '`animation.0.values.0` is "#12"; allowed: .*rrggbb'),
        ([track(interpolation="cubic")], '`animation.0.interpolation` is "cubic"'),
        ([track(speed=1)], "`animation.0.speed` is unknown"),
    ],
)
def test_faults_are_one_sentence(tracks: list[dict[str, Any]], message: str) -> None:
    with pytest.raises(SceneError, match=message) as caught:
        animated(*tracks, camera={"distance": 800})
    assert "\n" not in str(caught.value) and str(caught.value).startswith("scene: `animation.")


def test_values_that_meet_only_between_two_keys_are_told_with_their_frame() -> None:
    scene = animated(
        track("camera.origin", values=[[0, 0, 9], [0, 0, -9]]),
        camera={"origin": [0, 0, 9], "target": [0, 0, 0], "fov": 40},
    )
    assert scene.at(5).camera.origin is not None
    with pytest.raises(SceneError, match=r"`\"camera.origin\"` cannot be .* at frame 6: .*the same point"):
        scene.at(6)


def test_a_scene_changes_the_animation_of_its_base(tmp_path: Any) -> None:
    animated(track(), track("ambient", values=[0, 1]), camera={"distance": 800}).save(tmp_path / "base.toml")
    (tmp_path / "over.toml").write_text(
        'base = "base.toml"\n[[animation]]\nkey = "ambient"\ninterpolation = "smooth"\n'
        '[[animation]]\nkey = "camera.rotate.0"\ntimes = [1, 2]\nvalues = [0, 9]\n'
    )
    tracks = tracer.load(tmp_path / "over.toml").animation
    assert [(t.key, t.interpolation) for t in tracks] == [
        ("camera.distance", "linear"),
        ("ambient", "smooth"),
        ("camera.rotate.0", "linear"),
    ]
