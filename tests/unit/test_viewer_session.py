"""The viewer's session without a browser: sliders, choices, the way back, and what drafts leave out."""

from __future__ import annotations

from typing import Any

import pytest

import tracer
from tracer.errors import SceneError
from tracer.scene import Scene
from tracer.viewer.controls import Slider
from tracer.viewer.drafts import draft_of
from tracer.viewer.session import Session
from tracer.viewer.state import Source

SCENE: dict[str, Any] = {
    "camera": {"resolution": [64, 48], "distance": 800.0},
    "lights": [
        {"kind": "point", "position": [1, 2, 3], "weight": 2.0, "name": "lamp"},
        {"kind": "disk", "center": [0, 9, 0], "normal": [0, -1, 0], "radius": 1.0},
    ],
    "materials": {"glass": {"reflection": 0.2, "refraction": 0.6, "ior": 1.5}},
    "textures": {"tiles": {"kind": "checker", "colors": ["#fff", "#000"], "interval": 40.0}},
    "shapes": [
        {
            "kind": "sphere",
            "center": [0, 0, -300],
            "radius": 100,
            "material": "glass",
            "name": "ball",
            "color": [0.123, 0.5, 1.0],
        }
    ],
}


def load(choices: dict[str, bool]) -> Scene:
    """The scene; with the choice `cube`, one more shape, with `rotate` another camera."""
    scene = tracer.load(SCENE)
    if choices.get("cube"):
        scene.add_shape({"kind": "mesh", "builtin": "cube", "name": "cube", "color": "#f00"})
        scene.shapes = scene.shapes[::-1]
    if choices.get("rotate"):
        scene.camera.rotate = (20.0, 0.0)
    return scene


@pytest.fixture
def session() -> Session:
    labels = {"cube": ("Add the cube", "no", "yes"), "rotate": ("Rotate", "no", "yes")}
    return Session(Source(load, {"cube": False, "rotate": False}, labels))


def values(session: Session) -> dict[str, Any]:
    found: dict[str, Any] = session.values()["values"]
    return found


def test_every_number_of_the_issue_has_a_slider(session: Session) -> None:
    names = {control.name for control in session.controls}
    assert {"ambient", "cutoff", "lights.0.weight", "lights.0.position.1", "lights.1.center.2"} <= names
    assert {f"materials.glass.{key}" for key in ("reflection", "refraction", "absorption")} <= names
    assert {f"materials.glass.{key}" for key in ("ior", "diffuse", "specular", "shininess")} <= names
    assert {"textures.tiles.interval", "textures.tiles.colors.0", "textures.tiles.colors.1"} <= names
    assert {"background", "lights.0.color", "lights.1.color", "shapes.ball.color"} <= names
    assert "camera.depth_of_field.focus" not in names
    session.switch_focus(True, 900.0)
    assert values(session)["camera.depth_of_field.focus"] == 900.0
    assert all(
        control.low <= values(session)[control.name] <= control.high
        for control in session.controls
        if isinstance(control, Slider)
    )


def test_a_slider_changes_the_scene_and_not_the_one_that_was_shown(session: Session) -> None:
    before = session.view.scene
    session.set("lights.0.position.1", 5.0)
    session.set("ambient", 0.5)
    assert session.view.scene.lights[0].position == (1.0, 5.0, 3.0)  # type: ignore[attr-defined]
    assert session.view.scene.ambient == 0.5
    assert before == tracer.load(SCENE)


@pytest.mark.parametrize(
    ("key", "value", "shares"),
    [
        ("reflection", 0.5, (0.5, 0.375, 0.125)),
        ("reflection", 1.0, (1.0, 0.0, 0.0)),
        ("refraction", 0.0, (0.5, 0.0, 0.5)),
        ("absorption", 0.6, (0.1, 0.3, 0.6)),
        ("absorption", 0.0, (0.25, 0.75, 0.0)),
    ],
)
def test_the_shares_of_a_material_add_up_to_one(
    session: Session, key: str, value: float, shares: tuple[float, ...]
) -> None:
    session.set(f"materials.glass.{key}", value)
    glass = session.view.scene.materials["glass"]
    assert (glass.reflection, glass.refraction, glass.absorption) == pytest.approx(shares)
    session.view.scene.check()


def test_shares_move_on_from_their_ends(session: Session) -> None:
    session.set("materials.glass.absorption", 1.0)
    session.set("materials.glass.absorption", 0.7)
    glass = session.view.scene.materials["glass"]
    assert (glass.reflection, glass.refraction) == pytest.approx((0.3, 0.0))
    session.set("materials.glass.reflection", 1.0)
    session.set("materials.glass.refraction", 1.0)
    assert session.view.scene.materials["glass"].refraction == 1.0


def test_a_value_stays_within_its_range(session: Session) -> None:
    session.set("ambient", 7.0)
    assert session.view.scene.ambient == 1.0


@pytest.mark.parametrize("name", ["camera.fov", "base_dir", "shapes.0.file", "lights.0.weight.x", ""])
def test_what_has_no_slider_cannot_be_changed(session: Session, name: str) -> None:
    revision = session.view.revision
    with pytest.raises(SceneError, match="there is no control"):
        session.set(name, 1.0)
    assert session.view.revision == revision


def test_a_color_keeps_its_numbers_until_it_is_edited(session: Session) -> None:
    assert values(session)["shapes.ball.color"] == (0.123, 0.5, 1.0)
    session.paint("lights.0.color", "#ff8000", gesture=1)
    session.paint("textures.tiles.colors.1", "#0000FF", gesture=2)
    scene = session.view.scene
    assert scene.lights[0].color == (1.0, 128 / 255, 0.0)
    assert scene.textures["tiles"].colors == ((1.0, 1.0, 1.0), (0.0, 0.0, 1.0))  # type: ignore[attr-defined]
    assert scene.shapes[0].color == (0.123, 0.5, 1.0)
    session.undo()
    session.undo()
    assert session.view.scene == tracer.load(SCENE)


def test_a_choice_leaves_a_color_with_its_shape(session: Session) -> None:
    session.paint("shapes.ball.color", "#00ff00")
    session.choose("cube", True)
    assert [shape.color for shape in session.view.scene.shapes] == [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]


@pytest.mark.parametrize("name", ["ambient", "lights.0.position", "shapes.0.color", "camera.rotate"])
def test_what_has_no_color_cannot_be_painted(session: Session, name: str) -> None:
    with pytest.raises(SceneError, match="there is no control"):
        session.paint(name, "#ffffff")
    with pytest.raises(SceneError, match="there is no control"):
        session.set("lights.0.color", 1.0)


def test_a_gesture_is_undone_as_one(session: Session) -> None:
    start = session.view.scene
    for k in range(5):
        session.set("ambient", 0.3 + k / 10, gesture=1)
    session.orbit(5.0, 0.0, gesture=2)
    session.orbit(5.0, 0.0, gesture=2)
    assert session.values()["undo"] == 2
    session.undo()
    assert session.view.scene.camera == start.camera and session.view.scene.ambient == pytest.approx(0.7)
    session.undo()
    assert session.view.scene == start
    session.undo()
    assert session.view.scene == start


def test_a_choice_keeps_edits_and_camera(session: Session) -> None:
    session.set("ambient", 0.5)
    session.rotate(3.0, 0.0)
    session.choose("cube", True)
    scene = session.view.scene
    assert [shape.name for shape in scene.shapes] == ["cube", "ball"]
    assert scene.ambient == 0.5 and scene.camera.rotate == (3.0, 0.0)
    session.choose("rotate", True)
    assert session.view.scene.camera.rotate == (20.0, 0.0), "the choice that moves the camera does"
    session.undo()
    session.undo()
    assert [shape.name for shape in session.view.scene.shapes] == ["ball"]
    with pytest.raises(SceneError, match="there is no choice"):
        session.choose("cellar", True)


def test_the_camera_is_reset_to_that_of_the_file(session: Session) -> None:
    start = session.view.scene.camera
    session.grab(300.0)
    session.orbit(10.0, 5.0)
    session.pan(0.1, 0.1)
    session.dolly(0.3)
    session.shift((1.0, 2.0, 3.0))
    assert session.view.scene.camera != start
    session.reset_camera()
    assert session.view.scene.camera == start


def test_a_file_that_was_changed_is_read_again() -> None:
    tree: dict[str, Any] = {
        "shapes": [{"kind": "sphere", "center": [0, 0, -9], "radius": 1, "color": "#f00"}]
    }
    session = Session(Source(lambda _: tracer.load(tree)))
    session.set("ambient", 0.5)
    tree["lights"] = [{"kind": "point", "position": [1, 2, 3]}]
    tree["camera"] = {"resolution": [20, 10]}
    session.reload()
    scene = session.view.scene
    assert scene.ambient == 0.5 and len(scene.lights) == 1 and scene.camera.resolution == (20, 10)
    assert "lights.0.color" in {control.name for control in session.controls}
    session.rotate(5.0, 0.0)
    tree["camera"] = {"resolution": [40, 10]}
    session.reload()
    assert session.camera.resolution == (20, 10), "a camera that was moved stays"
    del tree["lights"]
    tree["shape"] = []
    before = session.view
    with pytest.raises(SceneError, match="shape"):
        session.reload()
    assert session.view is before
    session.undo()
    session.undo()
    assert session.view.scene.ambient != 0.5 and len(session.view.scene.lights) == 1


def test_every_change_is_told_once(session: Session) -> None:
    told: list[int] = []
    session.on_change = lambda: told.append(session.view.revision)
    session.set("ambient", 0.5)
    session.set("ambient", 0.5)
    session.show("depth")
    session.undo()
    session.undo()
    assert told == sorted(set(told)) and len(told) == 3


def test_a_draft_keeps_the_structure_that_was_loaded(session: Session) -> None:
    loaded = session.view.scene
    assert draft_of(loaded, loaded) is loaded
    session.set("lights.0.weight", 0.0)
    session.set("cutoff", 0.01)
    draft = draft_of(session.view.scene, loaded)
    assert 0 < draft.lights[0].weight < 1e-5 and draft.cutoff == loaded.cutoff
    assert session.view.scene.lights[0].weight == 0 and session.view.scene.cutoff == 0.01
    session.set("cutoff", 0.5)
    session.set("lights.0.weight", 1.0)
    assert draft_of(session.view.scene, loaded) is session.view.scene
