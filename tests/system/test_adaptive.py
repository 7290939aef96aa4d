"""`--supersample adaptive` as users run it: nearly the full grid for fewer rays; stopped, resumed; frames."""

from __future__ import annotations

import json
import os
import re
import signal
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.system.under_way import AT_ONCE, finish, start

ADAPTIVE = ("--supersample", "adaptive")
PLACE = ("--resolution", "320", "240")


def picture(file: Path) -> np.ndarray:
    return cv2.imread(str(file), cv2.IMREAD_UNCHANGED).astype(int)


@pytest.mark.slow
def test_nearly_the_full_grid_for_fewer_rays(repository: Path, tmp_path: Path) -> None:
    told = {}
    for name, options in {"full": ("--supersample", "3"), "adaptive": ADAPTIVE}.items():
        assert (
            finish(
                start(repository, tmp_path, "render", "classic", "-o", f"{name}.png", "--stats", *options)
            )[0]
            == 0
        )
        told[name] = json.loads((tmp_path / f"{name}.stats.json").read_text())
    difference = np.abs(picture(tmp_path / "full.png") - picture(tmp_path / "adaptive.png")).max(axis=2)
    assert (difference <= 1).mean() >= 0.99 and difference.max() > 1
    assert (told["adaptive"]["supersample"], told["adaptive"]["threshold"]) == (3, 0.015)
    refined = told["adaptive"]["refined_pixels"]
    assert told["adaptive"]["rays"]["primary"] == difference.size + 9 * refined
    assert sum(told["adaptive"]["rays"].values()) < 0.6 * sum(told["full"]["rays"].values())


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals as on POSIX systems")
def test_after_ctrl_c_the_picture_is_completed(repository: Path, tmp_path: Path) -> None:
    """With the same bytes; another threshold is refused by name."""
    grid = ("--set", "camera.supersample=16", "--threads", "1")
    command = (
        "render",
        "classic",
        "-o",
        "x.png",
        "-o",
        "x.exr",
        *PLACE,
        *ADAPTIVE,
        *grid,
        "--quiet",
        "--stats",
    )
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    whole.mkdir()
    broken.mkdir()
    assert finish(start(repository, whole, *command)) == (0, "")
    process = start(repository, broken, *command, begin=AT_ONCE)
    while not (broken / "x.work").exists():
        assert process.poll() is None, "it was over before anything was kept"
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    code, talk = finish(process)
    assert code == 130 and re.search(r"x\.partial\.png holds the finished \d+ % of classic", talk), talk
    code, talk = finish(start(repository, broken, *command, "--resume", "--threshold", "0.02"))
    assert code == 2 and "x.work: was begun with another `threshold`: 0.015, now 0.02" in talk, talk
    assert finish(start(repository, broken, *command, "--resume")) == (0, "")
    for name in ("x.png", "x.exr"):
        assert (broken / name).read_bytes() == (whole / name).read_bytes(), name
    assert not (broken / "x.work").exists() and not (broken / "x.partial.png").exists()


@pytest.mark.slow
def test_frames_are_adaptive_as_well(repository: Path, tmp_path: Path) -> None:
    settings = ("room", *PLACE, *ADAPTIVE, "--threshold", "0.03", "--quiet")
    assert finish(start(repository, tmp_path, "render", *settings, "-o", "one.png")) == (0, "")
    assert finish(start(repository, tmp_path, "turntable", *settings, "--frames", "3", "-o", "t.png")) == (
        0,
        "",
    )
    assert (tmp_path / "t.0001.png").read_bytes() == (tmp_path / "one.png").read_bytes()
    assert (tmp_path / "t.0002.png").read_bytes() != (tmp_path / "one.png").read_bytes()
