"""Saving loses nothing: a scene that was saved loads as the same scene."""

from __future__ import annotations

import random
import sys
from pathlib import Path
from typing import Any

import pytest

from tracer.errors import OutputError
from tracer.scene import Camera, Image, PointLight, Scene, Sphere, load
from tracer.scene.reference_page import PAGE, reference_page
from tracer.scene.schema import json_schema

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


def _number(random_: random.Random) -> float:
    return random_.choice([random_.uniform(-9, 9), random_.uniform(-1, 1) * 1e15, 0.1, -0.0, 5e-324, 3])


def _positive(random_: random.Random) -> float:
    return random_.choice([random_.uniform(1e-9, 9), 1e-300, 1 / 3, 7])


def _vector(random_: random.Random, count: int = 3) -> list[float]:
    return [_number(random_) for _ in range(count)]


def _color(random_: random.Random) -> Any:
    return random_.choice(["#70ff70", "#abc", [0, 0.5, 1], [random_.random() for _ in range(3)]])


def _maybe(random_: random.Random, **keys: Any) -> dict[str, Any]:
    return {key: value for key, value in keys.items() if random_.random() < 0.5}


def _lights(r: random.Random) -> list[dict[str, Any]]:
    area = {"center": _vector(r), "samples": r.randint(1, 99), "jitter": r.random() < 0.5}
    kinds: list[dict[str, Any]] = [
        {"kind": "point", "position": _vector(r)},
        {"kind": "ring", "normal": [0, 1e-9, 0], "radius": _positive(r), **area},
        {"kind": "disk", "normal": [1, 2, 3], "radius": _positive(r), **area},
        {"kind": "sphere", "radius": _positive(r), **area},
        {"kind": "rectangle", "normal": [0, 0, -5], "size": [_positive(r), _positive(r)], **area},
    ]
    chosen = r.sample(kinds, r.randint(0, 5))
    return [
        light | _maybe(r, weight=_positive(r), color=_color(r), name=f'light "{i}"')
        for i, light in enumerate(chosen)
    ]


def _shapes(r: random.Random) -> list[dict[str, Any]]:
    scale3 = r.choice([_positive(r), [1, 2, _positive(r)]])
    kinds: list[dict[str, Any]] = [
        {"kind": "plane", "coefficients": [0, 1, 0, _number(r)]} | _maybe(r, scale=_positive(r)),
        {"kind": "plane", "point": _vector(r), "u": [1, 0, 0], "v": [1, 1, 0]},
        {"kind": "sphere", "center": _vector(r), "radius": _positive(r)} | _maybe(r, scale=_positive(r)),
        {"kind": "mesh", "builtin": "tetrahedron"} | _maybe(r, smooth=True, scale=scale3),
        {"kind": "mesh", "vertices": [_vector(r) for _ in range(4)], "faces": [[0, 1, 2, 3], [2, 1, 0]]},
        {"kind": "instance", "of": "möbel.1"} | _maybe(r, smooth=False, scale=scale3),
    ]
    surface = r.choice([{"texture": "t"}, {"color": _color(r)}, {}])
    common = _maybe(
        r, material="m", translate=_vector(r), rotate=_vector(r), texture_space=r.choice(["world", "object"])
    )
    named = {"kind": "mesh", "builtin": "cube", "name": "möbel.1"}
    return [*(shape | surface | common for shape in r.sample(kinds, r.randint(0, 6))), named]


def _textures(r: random.Random) -> dict[str, Any]:
    options = _maybe(r, index=r.choice(["floor", "truncate"]))
    picture = options | {"file": "a.png"} | _maybe(r, flip_v=False, filter="bilinear")
    return {
        "t": {"kind": "solid", "color": _color(r)},
        "with spaces": {"kind": "stripes", "colors": [_color(r) for _ in range(5)], "interval": _positive(r)}
        | options,
        "file": {"kind": "checker", "colors": [_color(r), _color(r)], "interval": 40} | options,
        "image": {"kind": "image"} | picture | _maybe(r, direction="xz"),
        "affine.image": {"kind": "affine_image", "matrix": [_vector(r), _vector(r)], "offset": _vector(r, 2)}
        | picture,
    }


def _camera(r: random.Random) -> dict[str, Any]:
    look_at = {"origin": [0, 0, _positive(r)], "target": [1, 0, 0], "fov": r.uniform(1, 179)}
    canvas = _maybe(r, position=_vector(r), rotate=_vector(r, 2), pixel_size=1.0)
    focus = {"focus": r.choice([-1, 900.0]), **_maybe(r, samples=3, depth_range=_positive(r), seed=2**63 - 1)}
    common = _maybe(
        r, resolution=[3, 4], distance=_positive(r), supersample=3, pixel_offset=0.5, depth_of_field=focus
    )
    return r.choice([look_at | _maybe(r, up=[0, 0.5, 0.1]), canvas]) | common


def random_scene(seed: int) -> dict[str, Any]:
    """A scene tree that uses every kind and most keys, chosen by `seed`."""
    r = random.Random(seed)
    options = _maybe(
        r,
        version=1,
        literal=True,
        ambient=r.random(),
        background=_color(r),
        cutoff=0.1,
        max_depth=r.randint(0, 1024),
        seed=5,
        secondary_background=True,
        tir="reflect",
        transparent_shadows=False,
        diffuse_term="reflection",
        color_space="linear",
        camera=_camera(r),
        lights=_lights(r),
    )
    material = _maybe(
        r, ior=_positive(r), reflection=0.7, refraction=0.3, diffuse=2, specular=0.1, shininess=0
    )
    return options | {"shapes": _shapes(r), "textures": _textures(r), "materials": {"m": material}}


@pytest.mark.parametrize("seed", range(40))
def test_round_trip(tmp_path: Path, seed: int) -> None:
    (tmp_path / "a.png").touch()
    scene = load(random_scene(seed), base_dir=tmp_path)
    scene.save(tmp_path / "saved.toml")
    saved = load(tmp_path / "saved.toml")
    assert saved == scene
    assert load(scene.to_dict(), base_dir=scene.base_dir) == scene
    assert saved.to_dict() == scene.to_dict()
    assert tomllib.loads((tmp_path / "saved.toml").read_text(encoding="utf-8")) == scene.to_dict()


def test_equality_sees_every_part() -> None:
    one = Scene(shapes=[Sphere(center=(0, 0, 0), radius=1)])
    two = Scene(shapes=[Sphere(center=(0, 0, 0), radius=1 + 2e-16)])
    assert one != two
    assert one != one.to_dict()


def test_only_what_is_said_is_written() -> None:
    assert Scene().to_dict() == {"version": 1}
    assert Camera().to_dict() == {}
    assert Camera(supersample=1).to_dict() == {"supersample": 1}
    scene = Scene()
    scene.camera.supersample = 3
    scene.lights.append(PointLight(position=(0, 1, 0)))
    assert scene.to_dict() == {
        "version": 1,
        "camera": {"supersample": 3},
        "lights": [{"kind": "point", "position": [0.0, 1.0, 0.0]}],
    }


@pytest.mark.parametrize("byte", range(0, 256, 5))
def test_hexadecimal_colors_are_exact(byte: int) -> None:
    scene = Scene(background=f"#{byte:02x}00ff")
    assert scene.background == (byte / 255, 0, 1)
    assert scene.to_dict()["background"] == f"#{byte:02x}00ff"


def test_other_colors_keep_every_bit() -> None:
    color = (0.1, 1 / 3, 1 - 2**-53)
    assert Scene(background=color).to_dict()["background"] == list(color)
    assert Scene(background="#fa3") == Scene(background="#ffaa33")


def test_saving_elsewhere_rewrites_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tracer.scene.files.ASSETS", tmp_path / "assets")
    for file in ("scenes/own.png", "assets/shared.png"):
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).touch()
    (tmp_path / "scenes" / "copies").mkdir()
    (tmp_path / "elsewhere").mkdir()
    textures = {
        "own": {"kind": "image", "file": "own.png"},
        "shared": {"kind": "image", "file": "../assets/shared.png"},
    }
    scene = load({"textures": textures}, base_dir=tmp_path / "scenes")
    for folder, allow_outside in (("scenes/copies", True), ("elsewhere", True), (".", False)):
        scene.save(tmp_path / folder / "saved.toml")
        saved = load(tmp_path / folder / "saved.toml", allow_outside=allow_outside)
        for name, texture in saved.textures.items():
            assert isinstance(texture, Image)
            assert saved.resolve(texture.file) == scene.resolve(textures[name]["file"])
    assert saved.textures["shared"].file == "assets/shared.png"  # type: ignore[attr-defined]
    assert scene.textures["own"].file == "own.png"  # type: ignore[attr-defined]


def test_save_that_fails_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"no/a\.toml: cannot be written"):
        Scene().save(tmp_path / "no" / "a.toml")
    assert list(tmp_path.iterdir()) == []


def test_reference_page_is_current() -> None:
    assert PAGE.read_text(encoding="utf-8") == reference_page(), "run `python -m tracer.scene.reference_page`"


def test_every_key_of_the_schema_is_described() -> None:
    schema = json_schema()
    for title, record in {"Scene": schema, **schema["$defs"]}.items():
        for key, value in record["properties"].items():
            assert value.get("description"), f"{title}.{key} has no description"


def test_schema_knows_the_keys_of_files() -> None:
    schema = json_schema()
    assert {"base", "remove", "camera", "shapes"} <= schema["properties"].keys()
    assert schema["additionalProperties"] is False
    assert schema["$defs"]["Sphere"]["properties"]["radius"]["exclusiveMinimum"] == 0
