"""A scene in POV-Ray's terms: every kind has an adapter, and numbers survive."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

import tracer
from reference.povray import CAMERAS, body_of, texture_of, without_adapter
from reference.povray.document import export_povray
from reference.povray.mesh2 import mesh2, shared
from reference.povray.shapes import Surroundings
from reference.povray.text import Space, number
from tracer.camera import Camera
from tracer.errors import UsageError
from tracer.lights import LIGHT_KINDS, LightRecord
from tracer.shapes import SHAPE_KINDS, ShapeRecord
from tracer.textures import TEXTURE_KINDS, TextureRecord


def test_every_kind_has_an_adapter() -> None:
    assert without_adapter() == []
    assert list(CAMERAS) == [Camera]


def test_a_new_kind_without_adapter_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    class Cone(ShapeRecord):
        kind: Literal["cone"] = "cone"

    class Laser(LightRecord):
        kind: Literal["laser"] = "laser"

    class Marble(TextureRecord):
        kind: Literal["marble"] = "marble"

    monkeypatch.setitem(SHAPE_KINDS, "cone", Cone)
    monkeypatch.setitem(LIGHT_KINDS, "laser", Laser)
    monkeypatch.setitem(TEXTURE_KINDS, "marble", Marble)
    assert without_adapter() == ["shape cone", "light laser", "texture marble"]
    around = Surroundings(tracer.load({"camera": {"resolution": [4, 3]}}), {}, Space(1.0))
    with pytest.raises(UsageError, match='^POV-Ray has no counterpart of "cone": '):
        body_of(0, Cone(), around)
    with pytest.raises(UsageError, match='"marble"'):
        texture_of(Marble(), None)  # type: ignore[arg-type]


@pytest.mark.parametrize(("extent", "unit"), [(1000, 1), (256, 1), (8, 128), (1e-3, 2**20), (1e9, 2.0**-20)])
def test_small_and_huge_scenes_are_scaled_by_a_power_of_two(extent: float, unit: float) -> None:
    assert Space.of(extent).unit == unit


@pytest.mark.parametrize("value", [0.1, -1 / 3, 1e-12, 123456.789, 2.0, -0.0])
def test_numbers_lose_nothing(value: float) -> None:
    assert float(number(value)) == value
    assert number(value) != "-0"


def test_vertices_are_shared_and_keep_their_digits() -> None:
    rng = np.random.default_rng(3)
    vertices = rng.normal(size=(50, 3)).astype(np.float32).astype(np.float64)
    corners = vertices[rng.integers(0, 50, (200, 3))]
    rows, faces = shared(corners)
    assert len(rows) <= 50
    np.testing.assert_array_equal(rows[faces], corners)
    vectors = mesh2(corners, None).split("face_indices")[0]
    numbers = [[float(x) for x in row.split(",")] for row in re.findall("<(.*?)>", vectors)]
    np.testing.assert_array_equal(np.array(numbers, np.float32), rows)


def export(scene: dict, file: Path) -> tuple[str, list[str]]:
    """The exported text without its comments, and the remarks."""
    exported = export_povray(tracer.load(scene), file)
    lines = file.read_text(encoding="utf-8").splitlines()
    return "\n".join(line for line in lines if not line.startswith("//")), exported.remarks


def test_what_the_canvas_hides(tmp_path: Path) -> None:
    ball = {"kind": "sphere", "radius": 1}
    scene = {
        "camera": {"resolution": [64, 48], "distance": 800},
        "shapes": [
            ball | {"name": "seen", "center": [0, 0, -300]},
            ball | {"name": "before", "center": [0, 0, 300]},
            ball | {"name": "between", "center": [0, 0, 0]},
            ball | {"name": "aside", "center": [300, 0, 300]},
            {"kind": "plane", "coefficients": [0, 0, 1, -400]},
            {"kind": "plane", "coefficients": [1, 0, 0, -400]},
        ],
    }
    text, remarks = export(scene, tmp_path / "a.pov")
    hidden = [index for index in range(6) if re.search(rf"object {{ Body{index} .*no_image", text)]
    assert hidden == [1, 4]
    assert remarks == ["What of `between` lies between the eye and the canvas is seen, too."]


def test_what_has_no_counterpart_is_said(tmp_path: Path) -> None:
    scene = {
        "diffuse_term": "reflection",
        "background": "#102030",
        "max_depth": 500,
        "camera": {"depth_of_field": {"focus": 100}},
        "lights": [{"kind": "sphere", "center": [0, 9, 0], "radius": 1, "jitter": True}],
        "textures": {
            "many": {"kind": "stripes", "colors": [[i / 200] * 3 for i in range(200)], "interval": 1}
        },
        "materials": {"glass": {"refraction": 0.5, "ior": 1.5, "specular": 1}},
        "shapes": [
            {"kind": "sphere", "center": [0, 0, -9], "radius": 1, "material": "glass", "texture": "many"},
            {"kind": "mesh", "builtin": "cube", "translate": [0, 0, -99], "smooth": True},
        ],
    }
    text, remarks = export(scene, tmp_path / "a.pov")
    assert len(remarks) == 10 and len(set(remarks)) == 10
    said = (tmp_path / "a.pov").read_text(encoding="utf-8")
    assert all(f"// {remark}\n" in said for remark in remarks)
    assert "max_trace_level 256 " in text and text.count("light_source") == 16
