"""`base`, `remove` and `--set`: how one tree is laid over another."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tracer.errors import SceneError
from tracer.scene import Scene, load

BASE = """
ambient = 0.5
[camera]
resolution = [64, 48]
distance = 300
rotate = [20, 0]
[materials.glass]
ior = 1.5
reflection = 0.2
[textures.floor]
kind = "stripes"
colors = ["#fff", "#000", "#f00"]
interval = 3
[[lights]]
name = "lamp"
kind = "point"
position = [0, 9, 0]
[[shapes]]
name = "green ball"
kind = "sphere"
center = [0, 0, 0]
radius = 1
material = "glass"
texture = "floor"
[[shapes]]
kind = "plane"
coefficients = [0, 1, 0, 1]
[[shapes]]
name = "box"
kind = "mesh"
builtin = "cube"
"""


def _over(tmp_path: Path, text: str, base: str = BASE) -> Scene:
    (tmp_path / "base.toml").write_text(base)
    (tmp_path / "over.toml").write_text('base = "base.toml"\n' + text)
    return load(tmp_path / "over.toml")


def _refused(tmp_path: Path, text: str, match: str) -> None:
    with pytest.raises(SceneError, match=match):
        _over(tmp_path, text)


def test_tables_merge_key_by_key(tmp_path: Path) -> None:
    scene = _over(
        tmp_path, "[camera]\ndistance = 400\n[materials.glass]\nior = 1.3\n[materials.new]\nspecular = 1"
    )
    assert (scene.camera.resolution, scene.camera.distance, scene.ambient) == ((64, 48), 400, 0.5)
    assert (scene.materials["glass"].ior, scene.materials["glass"].reflection) == (1.3, 0.2)
    assert scene.materials["new"].specular == 1
    assert scene.name == "over"


def test_entries_merge_by_name_and_others_are_appended(tmp_path: Path) -> None:
    text = (
        '[[shapes]]\nname = "green ball"\nradius = 7\n[[shapes]]\nkind = "plane"\ncoefficients = [1, 0, 0, 0]'
    )
    scene = _over(tmp_path, text)
    assert [shape.kind for shape in scene.shapes] == ["sphere", "plane", "mesh", "plane"]
    ball = scene.shapes[0]
    assert (ball.radius, ball.center, ball.material) == (7, (0, 0, 0), "glass")  # type: ignore[attr-defined]


def test_other_lists_are_replaced(tmp_path: Path) -> None:
    scene = _over(tmp_path, '[textures.floor]\ncolors = ["#00f", "#0f0"]')
    assert scene.textures["floor"].colors == ((0, 0, 1), (0, 1, 0))  # type: ignore[attr-defined]
    assert scene.textures["floor"].interval == 3  # type: ignore[attr-defined]


def test_remove_drops_lights_and_shapes(tmp_path: Path) -> None:
    scene = _over(tmp_path, 'remove = ["lamp", "green ball"]')
    assert scene.lights == []
    assert [shape.name for shape in scene.shapes] == [None, "box"]
    again = _over(
        tmp_path, 'remove = ["box"]\n[[shapes]]\nname = "box"\nkind = "mesh"\nbuiltin = "tetrahedron"'
    )
    assert again.shapes[-1].builtin == "tetrahedron"  # type: ignore[attr-defined]


def test_wrong_remove(tmp_path: Path) -> None:
    _refused(
        tmp_path, 'remove = ["bax"]', r'over\.toml: `remove` has "bax", .* the nearest known name is `box`$'
    )
    _refused(tmp_path, 'remove = "box"', r'`remove` is "box"; allowed: a list of names')
    with pytest.raises(SceneError, match=r'`remove` has "box", which is no light or shape of the base'):
        load({"remove": ["box"]})


def test_a_key_drops_what_it_excludes(tmp_path: Path) -> None:
    ball = _over(tmp_path, '[[shapes]]\nname = "green ball"\ncolor = "#0f0"').shapes[0]
    assert (ball.color, ball.texture) == ((0, 1, 0), None)
    look_at = _over(tmp_path, "[camera]\norigin = [0, 0, 5]\ntarget = [0, 0, 0]\nfov = 40").camera
    assert (look_at.is_look_at, look_at.resolution, look_at.distance) == (True, (64, 48), None)
    mesh = _over(
        tmp_path, '[[shapes]]\nname = "box"\nkind = "sphere"\ncenter = [0, 0, 0]\nradius = 1'
    ).shapes[2]
    assert (mesh.kind, mesh.name) == ("sphere", "box")


def test_chain_of_bases(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(BASE)
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "b.toml").write_text('base = "../a.toml"\nambient = 0.6\n')
    (tmp_path / "c.toml").write_text('base = "sub/b.toml"\ncutoff = 0.1\n')
    scene = load(tmp_path / "c.toml")
    assert (scene.ambient, scene.cutoff, len(scene.shapes)) == (0.6, 0.1, 3)
    assert load({"base": "sub/b.toml"}, base_dir=tmp_path).ambient == 0.6


def test_files_of_a_base_stay_relative_to_it(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "a.png").touch()
    (tmp_path / "sub" / "b.toml").write_text('[textures.t]\nkind = "image"\nfile = "a.png"')
    (tmp_path / "c.toml").write_text('base = "sub/b.toml"')
    scene = load(tmp_path / "c.toml")
    assert scene.textures["t"].file == "sub/a.png"  # type: ignore[attr-defined]


def test_cycles_and_wrong_bases(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text('base = "b.toml"')
    (tmp_path / "b.toml").write_text('base = "a.toml"')
    with pytest.raises(SceneError, match=r"`base` leads back to a scene .*: a\.toml → b\.toml → a\.toml$"):
        load(tmp_path / "a.toml")
    (tmp_path / "a.toml").write_text('base = "a.toml"')
    with pytest.raises(SceneError, match=r"`base` leads back to a scene .*: a\.toml → a\.toml$"):
        load(tmp_path / "a.toml")
    (tmp_path / "sub").mkdir()
    for base, words in (
        ('"no.toml"', r'`base` is "no\.toml", which does not exist'),
        ('"../a.toml"', r"`base` is .*, outside the scene's folder"),
        ('"."', r'`base` is "\.", a directory; allowed: a file'),
        ("5", "`base` is 5; allowed: a scene file or a built-in name"),
    ):
        (tmp_path / "sub" / "c.toml").write_text(f"base = {base}")
        with pytest.raises(SceneError, match=words):
            load(tmp_path / "sub" / "c.toml")


def test_syntax_error_names_the_base(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text('base = "b.toml"')
    (tmp_path / "b.toml").write_text("x = ")
    with pytest.raises(SceneError, match=r"b\.toml, line 1, column 5: not valid TOML"):
        load(tmp_path / "a.toml")


# ---- overrides ----


def _scene(*overrides: str) -> Scene:
    ball = {"kind": "sphere", "name": "green ball", "center": [0, 0, 0], "radius": 1, "color": "#00ff00"}
    box = {"kind": "mesh", "builtin": "cube"}
    data: dict[str, Any] = {"materials": {"glass": {"ior": 1.5}}, "shapes": [ball, box]}
    return load(data, overrides=overrides)


def test_values_are_set() -> None:
    scene = _scene(
        "ambient=0.5",
        "camera.supersample = 2",
        'shapes."green ball".radius=3',
        "shapes.1.name=box",
        "shapes.1.scale=[1, 2, 3]",
        "materials.glass.ior=1.3",
        "shapes.'green ball'.center.1=5",
        "camera.depth_of_field.focus=900",
    )
    ball, box = scene.shapes
    assert (scene.ambient, scene.camera.supersample, scene.materials["glass"].ior) == (0.5, 2, 1.3)
    assert (ball.radius, ball.center) == (3, (0, 5, 0))  # type: ignore[attr-defined]
    assert (box.name, box.scale) == ("box", (1, 2, 3))  # type: ignore[attr-defined]
    assert scene.camera.depth_of_field is not None


def test_mapping_sets_values_as_they_are() -> None:
    assert load({}, overrides={"ambient": 0.25, "camera.resolution": (8, 6)}).camera.resolution == (8, 6)


def test_camera_form_can_be_changed_in_any_order() -> None:
    look_at = ["camera.origin=[0,0,5]", "camera.fov=40", "camera.distance=2", "camera.target=[0,0,0]"]
    for overrides in (look_at, look_at[::-1]):
        camera = load({"camera": {"distance": 300, "rotate": [20, 0]}}, overrides=overrides).camera
        assert (camera.is_look_at, camera.distance) == (True, 2)


def test_source_is_not_changed() -> None:
    data = {"shapes": [{"kind": "sphere", "center": [0, 0, 0], "radius": 1}]}
    load(data, overrides=["shapes.0.radius=2"])
    assert data == {"shapes": [{"kind": "sphere", "center": [0, 0, 0], "radius": 1}]}


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("ambiant=1", "`ambiant` is unknown; the nearest known key is `ambient`"),
        ("shape.0.radius=1", "`shape` is unknown; the nearest known key is `shapes`"),
        ("camera.resoltion=[1,1]", "`camera.resoltion` is unknown; the nearest known key is `resolution`"),
        ("camera.resolution.0=5", "`camera.resolution` is not stated in this scene; set it as a whole"),
        (
            'shapes."green boll".radius=1',
            '`shapes."green boll"` is unknown; the nearest known name is `green ball`',
        ),
        ("shapes.2.radius=1", "`shapes.2` is out of range; allowed: 0 to 1"),
        ("lights.0.weight=1", "`lights.0` is out of range; allowed: none, the list is empty"),
        ("shapes.0.radus=1", '`shapes."green ball".radus` is unknown; the nearest known key is `radius`'),
        ("shapes.0.radius=big", '`shapes."green ball".radius` is "big"; allowed: a number'),
        ("shapes.0.radius.x=1", "`shapes.0.radius` is 1; there is no `x` below it"),
        ("materials.glas.ior=1", "`materials.glas` is unknown; the nearest known material is `glass`"),
    ],
)
def test_wrong_overrides(override: str, words: str) -> None:
    with pytest.raises(SceneError) as caught:
        _scene(override)
    assert str(caught.value).startswith(f"scene: {words}")


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("camera", '--set "camera": has no `=`; allowed: key=value'),
        ("=5", '--set "=5": is no path; allowed: keys joined by dots'),
        ("camera..fov=5", '--set "camera..fov=5": is no path'),
        ('shapes."green ball.radius=5', "is no path"),
    ],
)
def test_malformed_overrides(override: str, words: str) -> None:
    with pytest.raises(SceneError) as caught:
        _scene(override)
    assert words in str(caught.value)
