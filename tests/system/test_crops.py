"""Crops put together have the bytes of the whole, and memory has a limit: the command itself."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from tracer.film.exr import read_exr

WIDTH, HEIGHT = 101, 67
CUTS = ((0, 40, WIDTH), (0, 9, 50, HEIGHT))
"""Between columns and between rows, none of them between two tiles."""


def render(repository: Path, folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "tracer.cli", "render", "--resolution", str(WIDTH), str(HEIGHT)]
    return subprocess.run(
        [*command, "--aov", "all", "--quiet", *options],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(repository)},
        capture_output=True,
        text=True,
        timeout=200,
    )


def files(name: str) -> list[str]:
    return ["-o", f"{name}.png", "-o", f"{name}.exr"]


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["classic", "option_depth_of_field"])
def test_crops_put_together_are_the_whole(scene: str, repository: Path, tmp_path: Path) -> None:
    assert render(repository, tmp_path, scene, *files("whole")).returncode == 0
    whole = cv2.imread(str(tmp_path / "whole.png"), cv2.IMREAD_UNCHANGED)
    layers, header = read_exr(tmp_path / "whole.exr")
    picture = np.zeros_like(whole)
    put_together = {name: np.zeros_like(layer) for name, layer in layers.items()}
    columns, rows = CUTS
    for y0, y1 in zip(rows, rows[1:], strict=False):
        for x0, x1 in zip(columns, columns[1:], strict=False):
            crop = ["--crop", *map(str, (x0, y0, x1, y1))]
            assert render(repository, tmp_path, scene, *files("crop"), *crop).returncode == 0
            picture[y0:y1, x0:x1] = cv2.imread(str(tmp_path / "crop.png"), cv2.IMREAD_UNCHANGED)
            part, part_header = read_exr(tmp_path / "crop.exr")
            assert part_header["dataWindow"] == (x0, y0, x1, y1)
            assert part_header["displayWindow"] == header["displayWindow"] == (0, 0, WIDTH, HEIGHT)
            assert part.keys() == layers.keys()
            for name, layer in part.items():
                put_together[name][y0:y1, x0:x1] = layer
    assert picture.tobytes() == whole.tobytes()
    assert [name for name in layers if put_together[name].tobytes() != layers[name].tobytes()] == []


def test_even_one_tile_may_be_too_much(repository: Path, tmp_path: Path) -> None:
    done = render(repository, tmp_path, "shape_sphere", "--memory", "30M")
    assert done.returncode == 2
    assert re.fullmatch(
        r"tracer: error: memory: the picture takes about \d+ MiB at least, allowed are 30 MiB; "
        r"a smaller --crop, --scale or fewer layers need less\n",
        done.stderr,
    )
    assert not list(tmp_path.iterdir())
    done = render(repository, tmp_path, "shape_sphere", "--memory", "much")
    assert done.returncode == 2
    assert "'much' is no size; allowed: a number and K, M, G or T, such as 2G" in done.stderr
