"""`--aov-png` as users run it: each layer as a picture beside the rendered one."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from tracer.film.false_color import false_color

Run = Callable[..., subprocess.CompletedProcess[str]]
SMALL = ("render", "room", "--resolution", "200", "200", "--aov-png")


@pytest.fixture
def tracer(repository: Path, tmp_path: Path) -> Run:
    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "tracer.cli", *arguments],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(repository)},
            capture_output=True,
            text=True,
            timeout=120,
        )

    return run


def names(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir())


def test_each_layer_is_a_picture_beside_the_first_file(tracer: Run, tmp_path: Path) -> None:
    # The depth is always there, and may be named.
    options = ("--aov", "depth", "--aov", "shape", "--aov", "visibility", "--crop", "10", "20", "200", "190")
    done = tracer(*SMALL, *options, "-o", "out.npz")
    assert (done.returncode, done.stderr) == (0, "")
    assert re.match(r"out\.npz, out\.LAYER\.png \(5 layers\)  190x170  ", done.stdout)
    layers = ["depth", "shape", *(f"visibility.light{k}" for k in range(3))]
    assert names(tmp_path) == sorted(["out.npz", *(f"out.{layer}.png" for layer in layers)])
    with np.load(tmp_path / "out.npz") as arrays:
        for layer in layers:
            name, _, light = layer.partition(".light")
            values = arrays[name][..., int(light)] if light else arrays[name]
            picture = cv2.imread(str(tmp_path / f"out.{layer}.png"))[..., ::-1]
            assert picture.shape == (170, 190, 3)
            assert np.array_equal(picture[:100], false_color(layer, values)[:100]), layer
            assert (picture[-1, 0] == picture[-1, 1]).all() and (picture[-1, 0] < 40).all(), "the legend"


def test_a_picture_of_the_same_name_is_refused(tracer: Run, tmp_path: Path) -> None:
    done = tracer(*SMALL, "-o", "a.png", "-o", "a.depth.png")
    assert done.returncode == 2
    assert re.fullmatch(r"tracer: error: a\.depth\.png: would be written twice for room; .*\n", done.stderr)
    assert names(tmp_path) == []


def test_frames_have_theirs(tracer: Run, tmp_path: Path) -> None:
    turn = ("turntable", "room", "--resolution", "80", "60", "--frames", "2", "--aov-png", "--aov", "normal")
    for options, files in (
        (("-o", "t.gif"), ["t.gif"]),
        (("-o", "t.png"), ["t.0001.png", "t.0002.png"]),
    ):
        done = tracer(*turn, *options)
        assert (done.returncode, done.stderr) == (0, "")
        assert "t.0001.LAYER.png (2 layers)" in done.stdout
        layers = [f"t.000{frame}.{layer}.png" for frame in (1, 2) for layer in ("depth", "normal")]
        assert names(tmp_path) == sorted([*files, *layers])
        for name in files:
            (tmp_path / name).unlink()
    first, second = ((tmp_path / f"t.000{k}.normal.png").read_bytes() for k in (1, 2))
    assert first != second
