"""`tracer export --to povray`: POV-Ray, where it is installed, shows the same shapes in the same colors."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import tracer
from reference.povray.document import export_povray
from tracer.assets import builtin_scenes
from tracer.canvas import Canvas
from tracer.cli.app import run

POVRAY = shutil.which("povray")
needs_povray = pytest.mark.skipif(POVRAY is None, reason="POV-Ray is not installed: apt install povray")

COLOR = 1e-3
"""Colors may differ by so much away from edges: POV-Ray's 16 bits and its highlights in single precision."""

CANVAS_CAMERA = {
    "resolution": [160, 120],
    "pixel_size": 0.5,
    "distance": 100,
    "position": [0, 60, 90],
    "rotate": [5, -20],
}
LOOK_AT = {
    "resolution": [80, 60],
    "origin": [30, 60, 180],
    "target": [0, 15, 0],
    "fov": 40,
    "pixel_offset": 0.2,
}
LIGHTS = [{"kind": "point", "position": [80, 150, 90]}]
FLOOR = {"kind": "plane", "coefficients": [0, 1, 0, 0]}
BALLS = [
    {"kind": "sphere", "center": [-25, 20, 0], "radius": 20, "color": "#c04030"},
    {"kind": "sphere", "center": [25, 15, -20], "radius": 15, "color": "#3060c0"},
]
CUBE = {"kind": "mesh", "builtin": "cube", "scale": 18, "rotate": [10, 30, 0], "translate": [0, 24, 5]}

SCENES: dict[str, dict[str, Any]] = {
    "matte": {"shapes": [FLOOR | {"color": "#a0b090"}, *BALLS]},
    "lights": {
        "shapes": [FLOOR, *BALLS],
        "lights": [*LIGHTS, {"kind": "disk", "center": [-90, 120, 40], "normal": [1, -1, 0], "radius": 30,
                             "weight": 0.5, "color": "#ffc080"}],
    },
    "linear": {"shapes": [FLOOR | {"color": "#a0b090"}, *BALLS], "color_space": "linear"},
    "mirror": {
        "cutoff": 0.001,
        "materials": {"mirror": {"reflection": 0.8, "diffuse": 0.5}},
        "shapes": [FLOOR | {"color": "#a0b090"}, BALLS[0] | {"material": "mirror"}, BALLS[1]],
    },
    "glass": {
        "cutoff": 0.001,
        "materials": {"glass": {"refraction": 0.7, "reflection": 0.1, "ior": 1.5, "diffuse": 0.5}},
        "shapes": [FLOOR | {"color": "#a0b090"}, BALLS[0] | {"material": "glass"}, BALLS[1]],
    },
    "shadows of glass": {
        "cutoff": 0.001,
        "transparent_shadows": True,
        "materials": {"glass": {"refraction": 0.7, "ior": 1.2}},
        "shapes": [FLOOR, BALLS[0] | {"material": "glass"}, BALLS[1]],
    },
    "checker": {
        "textures": {"tiles": {"kind": "checker", "colors": ["#ffffff", "#203040"], "interval": 30}},
        "shapes": [FLOOR | {"texture": "tiles"}, BALLS[0] | {"color": None, "texture": "tiles"}],
    },
    "checker cut off": {
        "textures": {"tiles": {"kind": "checker", "colors": ["#ffffff", "#203040"], "interval": 30,
                               "index": "truncate"}},
        "shapes": [FLOOR | {"texture": "tiles"}],
    },
    "stripes": {
        "textures": {
            "bands": {"kind": "stripes", "colors": ["#f00000", "#00f000", "#4040f0"], "interval": 30}
        },
        "shapes": [FLOOR | {"texture": "bands"}, CUBE | {"texture": "bands", "texture_space": "object"}],
    },
    "meshes": {"shapes": [FLOOR, CUBE | {"color": "#80c040"}]},
    "smooth": {"shapes": [FLOOR, {"kind": "mesh", "file": "assets/teapot.obj", "scale": 12, "smooth": True}]},
}  # fmt: skip


def scene_of(name: str, camera: dict[str, Any]) -> tracer.Scene:
    def clean(shape: dict[str, Any]) -> dict[str, Any]:
        return {key: value for key, value in shape.items() if value is not None}

    scene = {"camera": camera, "lights": LIGHTS, **SCENES[name]}
    return tracer.load({**scene, "shapes": [clean(shape) for shape in scene["shapes"]]})


def picture_of(file: Path, width: int, height: int) -> np.ndarray:
    """What POV-Ray makes of a file, with 16 bits a component."""
    command = [str(POVRAY), f"+I{file.name}", f"+W{width}", f"+H{height}", "-A", "-D", "+FN16", "+Oa.png"]
    done = subprocess.run(command, cwd=file.parent, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    picture = cv2.imread(str(file.with_name("a.png")), cv2.IMREAD_UNCHANGED)
    assert picture is not None
    return picture[..., 2::-1] / 65535


def at_edges(values: np.ndarray, jump: float) -> np.ndarray:
    """Pixels next to one whose value differs by more than `jump`."""
    edge = np.zeros(values.shape, bool)
    for axis in (0, 1):
        jumps = np.abs(np.diff(values, axis=axis)) > jump
        edge |= np.insert(jumps, 0, False, axis) | np.insert(jumps, jumps.shape[axis], False, axis)
    return edge


@needs_povray
@pytest.mark.slow
@pytest.mark.parametrize("camera", [CANVAS_CAMERA, LOOK_AT], ids=["canvas", "look-at"])
@pytest.mark.parametrize("name", SCENES)
def test_colors_are_those_of_the_tracer(name: str, camera: dict[str, Any], tmp_path: Path) -> None:
    if name == "smooth":
        camera = camera | {"pixel_offset": 0.5}
    scene = scene_of(name, camera)
    export_povray(scene, tmp_path / "a.pov")
    width, height = scene.camera.resolution
    ours = tracer.render(scene, precision="double")
    theirs = picture_of(tmp_path / "a.pov", width, height)
    differing = np.abs(theirs - np.clip(ours.color, 0, 1)).max(axis=-1) > COLOR
    edges = np.any([at_edges(ours.color[..., c], 0.04) for c in range(3)], axis=0)
    assert edges.mean() < 0.7
    assert np.count_nonzero(differing & ~edges) == 0
    assert differing.mean() < 1e-3


@needs_povray
@pytest.mark.parametrize("camera", [CANVAS_CAMERA, LOOK_AT], ids=["canvas", "look-at"])
def test_depth_is_that_of_the_tracer(camera: dict[str, Any], tmp_path: Path) -> None:
    """All looks become the distance from the eye, in 500 units."""
    scene = scene_of("meshes", camera)
    file = tmp_path / "a.pov"
    export_povray(scene, file)
    text = file.read_text(encoding="utf-8")
    unit = float(re.findall(r"a scene unit is ([\d.e-]+) here", text)[0])
    canvas = Canvas.of(scene.camera)
    eye = canvas.eye * [unit, unit, -unit]
    squares = "+".join(
        f"({axis}-({value}))*({axis}-({value}))" for axis, value in zip("xyz", eye, strict=True)
    )
    pigment = f"function {{ sqrt({squares})/{500 * unit} }} color_map {{ [0 rgb 0] [1 rgb 1] }}"
    look = f"texture {{ pigment {{ {pigment} }} finish {{ ambient 1 diffuse 0 }} }}"
    file.write_text(re.sub(r"(#declare Look\d+ = ).*", rf"\1{look}", text), encoding="utf-8")
    ours = tracer.render(scene, precision="double").depth
    height, width = ours.shape
    x = (np.arange(width) + canvas.offset - width / 2) * canvas.pixel_size
    y = (np.arange(height) + canvas.offset - height / 2) * canvas.pixel_size
    to_canvas = np.sqrt(canvas.distance**2 + x[None, :] ** 2 + y[:, None] ** 2)
    seen = picture_of(file, width, height)[..., 0] * 500
    blank = seen == 0
    far = (ours < 0) | (ours + to_canvas > 495)
    edges = at_edges(ours, 10.0)
    assert np.count_nonzero((blank != (ours < 0)) & ~edges) == 0
    error = np.abs(seen - to_canvas - ours)
    assert error[~far & ~edges].max() < 0.02
    assert np.count_nonzero(error[~far] > 0.02) <= 0.01 * ours.size


@needs_povray
@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(builtin_scenes()))
def test_every_built_in_scene_is_rendered(name: str, tmp_path: Path) -> None:
    file = tmp_path / f"{name}.pov"
    assert run(["export", name, "--to", "povray", "--scale", "0.05", "-o", str(file)]) == 0
    resolution = tracer.load(name).camera.resolution
    picture = picture_of(file, *(round(side * 0.05) for side in resolution))
    assert picture.max() > 0.05


def test_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["export", "texture_image", "--to", "povray", "--scale", "0.1"]) == 0
    said = capsys.readouterr()
    assert said.out == "texture_image.pov, texture_image-0-fox.png\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "texture_image-0-fox.png",
        "texture_image.pov",
    ]
    assert run(["export", "room", "--to", "povray"]) == 0
    assert "tracer: room: The cut-off counts the colors on the way" in capsys.readouterr().err
    assert run(["export", "room", "--to", "povray", "-o", "room.xml"]) == 2
    assert 'room.xml: the extension ".xml" is unknown; allowed: .pov' in capsys.readouterr().err


def test_a_copied_picture_has_the_texels_of_its_source(tmp_path: Path) -> None:
    deep = (np.arange(48, dtype=np.uint16) * 1300).reshape(4, 4, 3)
    cv2.imwrite(str(tmp_path / "deep.png"), deep)
    scene = {
        "textures": {"wall": {"kind": "image", "file": "deep.png"}},
        "shapes": [FLOOR | {"texture": "wall"}],
    }
    exported = export_povray(tracer.load(scene, base_dir=tmp_path), tmp_path / "a.pov")
    copied = cv2.imread(str(exported.pieces[0]), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(copied, deep)
