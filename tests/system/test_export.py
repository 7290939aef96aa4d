"""`tracer export`: what it writes is rendered by the stock program `mitsuba`, and shows the same shapes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import OpenEXR
import pytest

import tracer
from reference.mitsuba_variant import mitsuba
from tracer.canvas import Canvas
from tracer.cli.app import run
from tracer.scene import Scene

MITSUBA = Path(sys.executable).with_name("mitsuba")
WIDTH = 64

SMALL_SCENE = """
[camera]
resolution = [8, 6]
distance = 20
[[lights]]
kind = "point"
position = [3, 5, 40]
[[shapes]]
name = "ball -- <&>"
kind = "sphere"
center = [0, 0, -10]
radius = 2
"""


@pytest.fixture
def small(tmp_path: Path) -> Path:
    file = tmp_path / "small.toml"
    file.write_text(SMALL_SCENE)
    return file


def small_canvas(scene: Scene) -> tuple[float, Canvas]:
    scale = WIDTH / scene.camera.resolution[0]
    return scale, Canvas.of(scene.camera, scene.literal).scaled(scale)


def depth_of_export(file: Path) -> np.ndarray:
    """The depth buffer of the exported file by Mitsuba's own loader and sensor, -1 on a miss."""
    mi = mitsuba()
    scene = mi.load_file(str(file))
    sensor = scene.sensors()[0]
    width, height = sensor.film().size()
    column, row = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    place = mi.Point2f(mi.Float(column.ravel()), mi.Float(row.ravel()))
    ray, _ = sensor.sample_ray(0.0, 0.5, place, mi.Point2f(0.5))
    hit = scene.ray_intersect_preliminary(ray)
    depth = np.where(hit.is_valid().numpy(), hit.t.numpy(), -1.0)
    return depth.reshape(int(height), int(width))


def at_edges(depth: np.ndarray, margin: float) -> np.ndarray:
    """Pixels next to one whose depth differs by more than `margin`, and those that border on a miss."""
    edge = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        jump = np.abs(np.diff(depth, axis=axis)) > margin
        edge |= np.insert(jump, 0, False, axis) | np.insert(jump, jump.shape[axis], False, axis)
    return edge


@pytest.mark.slow
@pytest.mark.parametrize("name", ["classic", "room", "shape_mesh", "option_depth_of_field"])
def test_the_stock_program_renders_the_same_shapes(name: str, tmp_path: Path) -> None:
    scene = tracer.load(name)
    scale, canvas = small_canvas(scene)
    file = tmp_path / f"{name}.xml"
    assert run(["export", name, "--to", "mitsuba", "--scale", str(scale), "-o", str(file)]) == 0
    ours = tracer.render(scene, scale=scale, supersample=1, precision="double").depth
    depth = depth_of_export(file)
    assert depth.shape == ours.shape == (canvas.height, canvas.width)
    size = float(ours.max())
    differing = (np.abs(depth - ours) > 1e-4 * size) | ((depth < 0) != (ours < 0))
    assert not (differing & ~at_edges(ours, 0.02 * size)).any()
    assert differing.mean() < 0.01

    done = subprocess.run(
        [MITSUBA, "-m", "scalar_rgb", "-Dspp=2", file.name],
        cwd=tmp_path,
        env=os.environ,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    with OpenEXR.File(str(file.with_suffix(".exr"))) as picture:
        color = picture.channels()["RGB"].pixels
    assert color.shape == (*ours.shape, 3) and np.isfinite(color).all()
    assert (color[(ours < 0) & ~at_edges(ours, 0)] == 0).all()  # its samples lie anywhere in their pixels
    lit = color[ours > 0].mean(axis=1)
    assert np.mean(lit > 0) > 0.8
    assert 0.02 < np.median(lit) < 2  # as bright as a picture should be


def test_the_file_says_what_is_left_out(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = small.with_name("out.xml")
    assert run(["export", str(small), "--to", "mitsuba", "-o", str(target)]) == 0
    said = capsys.readouterr()
    assert said.out == f"{target}\n"
    assert "tracer: small: Light falls off with distance" in said.err
    text = target.read_text(encoding="utf-8")
    assert "small, by tracer export." in text and "Light falls off with distance" in text
    assert "<!-- ball - - &lt;&amp;&gt; -->" in text or "<!-- ball - - <&> -->" in text
    root = ElementTree.fromstring(text)
    assert [shape.get("id") for shape in root.iter("shape")] == ["shape0"]
    assert sorted(path.name for path in small.parent.iterdir()) == ["out.xml", "small.toml"]


def test_meshes_and_pictures_stand_beside_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["export", "texture_image", "--to", "mitsuba", "--scale", "0.1"]) == 0
    assert run(["export", "shape_instance", "--to", "mitsuba", "--scale", "0.1", "-o", "{name} $2.xml"]) == 0
    names = {path.name for path in tmp_path.iterdir()}
    for file in ("texture_image.xml", "shape_instance $2.xml"):
        tree = ElementTree.parse(tmp_path / file)
        named = {entry.get("value") for entry in tree.iter("string") if entry.get("name") == "filename"}
        assert named and named <= names
    assert not any(name.startswith(".") for name in names)


def test_the_numbers_of_the_shapes_survive(tmp_path: Path) -> None:
    file = tmp_path / "mesh.xml"
    assert run(["export", "shape_mesh", "--to", "mitsuba", "-o", str(file)]) == 0
    loaded = mitsuba().load_file(str(file), optimize=False)
    count = len(tracer.load("shape_mesh").shapes)
    assert {shape.id() for shape in loaded.shapes()} == {f"shape{number}" for number in range(count)}


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--to", "mitsuba", "-o", "a.obj"], 'a.obj: the extension ".obj" is unknown; allowed: .xml'),
        (["--to", "mitsuba", "-o", "gone/a.xml"], "gone/a.xml: the folder gone does not exist"),
        (["--to", "mitsuba", "--scale", "0"], "scale: 0.0 is out of range; allowed is a number above 0"),
        (["--to", "blender"], "Invalid value for '--to': 'blender' is not one of 'mitsuba', 'povray'."),
        ([], "Missing option '--to'."),
    ],
)
def test_bad_usage(
    arguments: list[str],
    sentence: str,
    small: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(small.parent)
    assert run(["export", "small.toml", *arguments]) == 2
    assert sentence in capsys.readouterr().err
    assert [path.name for path in small.parent.iterdir()] == ["small.toml"]


def test_without_mitsuba(
    small: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    target = small.with_name("out.xml")
    assert run(["export", str(small), "--to", "mitsuba", "-o", str(target)]) == 3
    assert "tracer: error: Mitsuba is not installed; `pip install" in capsys.readouterr().err
    assert not target.exists()


def test_a_failure_leaves_nothing(
    small: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import reference.mitsuba_xml

    def full(*_: object) -> float:
        raise OSError(28, "No space left on device")

    target = small.with_name("out.xml")
    target.write_text("as it was")
    monkeypatch.setattr(reference.mitsuba_xml, "light_strength", full)
    assert run(["export", str(small), "--to", "mitsuba", "-o", str(target)]) == 2
    assert capsys.readouterr().err == f"tracer: error: {target}: cannot be written: No space left on device\n"
    assert target.read_text() == "as it was"
    assert sorted(path.name for path in small.parent.iterdir()) == ["out.xml", "small.toml"]


def test_the_help_has_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["export", "--help"]) == 0
    assert "tracer export classic --to mitsuba -o classic.xml" in capsys.readouterr().out
