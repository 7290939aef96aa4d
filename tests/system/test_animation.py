"""`tracer turntable` and `tracer render --frames` as users run them, and the movies that come out."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tracer.film.result import load_picture_file

Run = Callable[..., subprocess.CompletedProcess[str]]
COMMAND = [sys.executable, "-m", "tracer.cli"]

SCENE = """
background = "#4060a0"
[camera]
resolution = [64, 48]
[[lights]]
kind = "point"
position = [300, 500, 400]
[[shapes]]
name = "red ball"
kind = "sphere"
center = [-10, 0, -100]
radius = 6
color = "#ff2010"
[[shapes]]
kind = "sphere"
center = [10, 0, -100]
radius = 6
color = "#10ff20"
[[animation]]
key = 'shapes."red ball".center'
times = [1, 5]
values = [[-10, 0, -100], [-10, 8, -100]]
"""


@pytest.fixture
def variables(repository: Path) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(repository)}


@pytest.fixture
def tracer(variables: dict[str, str], tmp_path: Path) -> Run:
    """Runs `tracer` in a folder that holds balls.toml."""
    (tmp_path / "balls.toml").write_text(SCENE)

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [*COMMAND, *arguments], cwd=tmp_path, env=variables, capture_output=True, text=True, timeout=120
        )

    return run


def names(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir() if file.name != "balls.toml")


def frames_of(movie: Path) -> Iterator[Any]:
    """The frames of a movie, (h, w, 3) bytes, red first; OpenCV has a decoder of its own."""
    reader = cv2.VideoCapture(str(movie))
    while (found := reader.read())[0]:
        yield found[1][..., ::-1]
    reader.release()


def red_row(picture: Any) -> float:
    """The mean row of what is red."""
    red = (picture[..., 0] > 0.2) & (picture[..., 1] < 0.2)
    return float(np.nonzero(red)[0].mean())


def test_a_turntable_in_all_forms(tracer: Run, tmp_path: Path) -> None:
    done = tracer(
        *("turntable", "balls.toml", "--frames", "6", "--fps", "10"),
        *("-o", "{name}.mp4", "-o", "turn.webm", "-o", "turn.gif", "-o", "t.png", "-o", "e/{frame}.exr"),
    )
    assert done.returncode == 2 and "folder e does not exist" in done.stderr
    (tmp_path / "e").mkdir()
    done = tracer(
        *("turntable", "balls.toml", "--frames", "6", "--fps", "10"),
        *("-o", "{name}.mp4", "-o", "turn.webm", "-o", "turn.gif", "-o", "t.png", "-o", "e/{frame}.exr"),
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert re.fullmatch(
        r"balls\.mp4, turn\.webm, turn\.gif, t\.0001\.png \.\.\. t\.0006\.png, e/1\.exr \.\.\. e/6\.exr  "
        r"6 frames  \d+\.\d\d s  \d+\.\d\d frames/s\n",
        done.stdout,
    )
    pictures = [f"t.000{k}.png" for k in range(1, 7)]
    assert names(tmp_path) == sorted(["balls.mp4", "turn.webm", "turn.gif", "e", *pictures])
    assert names(tmp_path / "e") == [f"{k}.exr" for k in range(1, 7)]
    stills = [load_picture_file(tmp_path / name) for name in pictures]
    for movie, tolerance in (("balls.mp4", 0.06), ("turn.webm", 0.06), ("turn.gif", 0.06)):
        decoded = np.array(list(frames_of(tmp_path / movie))) / 255
        assert decoded.shape == (6, 48, 64, 3), movie
        assert np.abs(decoded - np.array(stills)).mean() < tolerance, movie
        assert np.abs(decoded[:, 2, 2] - [64 / 255, 96 / 255, 160 / 255]).max() < 0.02, movie
    # Half a turn later the red ball is on the other side.
    columns = [np.nonzero((still[..., 0] > 0.3) & (still[..., 1] < 0.2))[1].mean() for still in stills[::3]]
    assert columns[0] < 31 and columns[1] > 33


def test_the_first_frame_is_the_scene_and_the_same_bytes_come_again(tracer: Run, tmp_path: Path) -> None:
    for name in ("a", "b"):
        done = tracer("turntable", "balls.toml", "--frames", "3", "-o", f"{name}.mp4", "-o", f"{name}.png")
        assert done.returncode == 0
    tracer("render", "balls.toml")
    still = (tmp_path / "balls.png").read_bytes()
    assert (tmp_path / "a.0001.png").read_bytes() == still != (tmp_path / "a.0002.png").read_bytes()
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()


def test_frames_of_an_animation(tracer: Run, tmp_path: Path) -> None:
    done = tracer("render", "balls.toml", "--frames", "1:7:2")
    assert (done.returncode, done.stderr) == (0, "")
    assert names(tmp_path) == [f"balls.000{k}.png" for k in (1, 3, 5, 7)]
    rows = [red_row(load_picture_file(tmp_path / f"balls.000{k}.png")) for k in (1, 3, 5, 7)]
    assert rows[0] - rows[1] == pytest.approx(4 * 800 / 900, abs=0.7), "4 units up, seen from 900 at 800"
    assert rows[1] - rows[2] == pytest.approx(4 * 800 / 900, abs=0.7)
    assert rows[2] == rows[3], "after its last time a key stays as it is"


def test_one_frame_is_one(tracer: Run, tmp_path: Path) -> None:
    done = tracer("render", "balls.toml", "--frames", "3")
    assert done.stdout.startswith("balls.0003.png  1 frame  "), done.stdout
    assert names(tmp_path) == ["balls.0003.png"]


def test_what_cannot_be_rendered_is_refused_at_once(tracer: Run, tmp_path: Path) -> None:
    cases = [
        (("render", "balls.toml", "--frames", "5:1"), "--frames 5:1: is out of range"),
        (("render", "balls.toml", "--frames", "1:5:0"), "out of range"),
        (("render", "balls.toml", "--frames", "1:x"), "is no range"),
        (("render", "balls.toml", "--frames", "1:99999999"), "out of range"),
        (("render", "balls.toml", "--frames", "1:3", "-o", "a{frame}.mp4"), "a movie holds all frames"),
        (("render", "balls.toml", "--frames", "1:3", "-o", "a.avi"), r'"\.avi" is unknown; .*\.png.*\.mp4'),
        (("render", "balls.toml", "--frames", "1:3", "-o", "a{shot}.png"), r"unknown field \{shot\}"),
        (("render", "balls.toml", "--frames", "1:3", "-o", "no/a.png"), "the folder no does not exist"),
        (("render", "balls.toml", "--frames", "1:3", "--set", "animation.0.key=camera.fvo"), "`fvo`"),
        (("render", "balls.toml", "--frames", "1:3", "--set", "animation.0.times=[5, 1]"), "increasing"),
        (("turntable", "balls.toml", "--frames", "0"), "--frames"),
        (("turntable", "balls.toml", "--fps", "0"), "--fps"),
        (("turntable", "balls.toml", "--set", "shapes=[]", "--set", "animation=[]"), "--around names one"),
        (("turntable", "balls.toml", "--around", "0", "nan", "0"), "--around.*nan is not a finite number"),
        (("turntable", "balls.toml", "--around", "inf", "0", "0"), "--around.*inf is not a finite number"),
        (("turntable", "nowhere.toml"), "no such scene"),
    ]
    for arguments, message in cases:
        done = tracer(*arguments)
        assert re.fullmatch(f"tracer: error: .*{message}.*\n", done.stderr), (arguments, done.stderr)
        assert (done.returncode, done.stdout) == (2, ""), arguments
    assert names(tmp_path) == []


def test_a_scene_that_stands_still_is_told(tracer: Run, tmp_path: Path) -> None:
    done = tracer("render", "balls.toml", "--frames", "2", "--set", "animation=[]")
    assert done.returncode == 0 and "has no [[animation]]" in done.stderr
    assert names(tmp_path) == ["balls.0002.png"]


def test_resume_keeps_what_belongs_to_it(
    tracer: Run, variables: dict[str, str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A movie that could not be written leaves its frames; the next run renders only what is missing."""
    turn = ("turntable", "balls.toml", "--frames", "4", "-o", "t.mp4", "--aov-png")
    assert tracer(*turn).returncode == 0
    whole = (tmp_path / "t.mp4").read_bytes()

    (tmp_path / "t.mp4").unlink()
    monkeypatch.setitem(variables, "IMAGEIO_FFMPEG_EXE", sys.executable)
    failed = tracer(*turn)
    monkeypatch.undo()
    assert failed.returncode == 2 and "ffmpeg could not write it" in failed.stderr
    kept = names(tmp_path / "t.frames")
    assert kept == [*(f"000{k}.png" for k in range(1, 5)), "frames.json"]
    (tmp_path / "t.frames" / "0003.png").write_bytes(b"damaged")
    (tmp_path / "t.frames" / "0001.png").unlink()
    (tmp_path / "t.0004.depth.png").unlink()
    before = (tmp_path / "t.frames" / "0002.png").stat().st_mtime_ns

    for option, what in (
        (("--supersample", "2"), "--supersample"),
        (("--set", "ambient=0.3"), "scene"),
        (("--frames", "5"), "course of the camera"),
        (("--around", "0", "0", "0"), "course of the camera"),
    ):
        done = tracer(*turn, "--resume", *option)
        assert done.returncode == 2 and f"have another {what} than" in done.stderr, done.stderr
    assert (tmp_path / "t.frames" / "0002.png").stat().st_mtime_ns == before
    done = tracer(*turn, "--resume")
    assert done.returncode == 0 and "4 frames (1 was finished before)" in done.stdout
    assert (tmp_path / "t.mp4").read_bytes() == whole
    assert names(tmp_path) == [*(f"t.000{k}.depth.png" for k in range(1, 5)), "t.mp4"]


def test_a_folder_of_the_same_name_is_left_alone(tracer: Run, tmp_path: Path) -> None:
    (tmp_path / "t.frames").mkdir()
    (tmp_path / "t.frames" / "mine.txt").write_text("mine")
    assert tracer("turntable", "balls.toml", "--frames", "2", "-o", "t.gif").returncode == 0
    assert "mine.txt" in names(tmp_path / "t.frames")


def start(folder: Path, variables: dict[str, str], *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*COMMAND, *arguments],
        cwd=folder,
        env=variables,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


LONG = ("turntable", "classic", "--scale", "0.1", "--frames", "30", "-o", "t.mp4", "-o", "t.npz", "--stats")


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals as on POSIX systems")
def test_ctrl_c_loses_no_finished_frame(variables: dict[str, str], tmp_path: Path) -> None:
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    whole.mkdir()
    broken.mkdir()
    process = start(whole, variables, *LONG)
    process.communicate()
    assert process.returncode == 0

    process = start(broken, variables, *LONG, "--progress", "json")
    assert process.stderr is not None
    while json.loads(process.stderr.readline())["done"] < 5 * 128 * 96:
        pass
    process.send_signal(signal.SIGINT)
    output, talk = process.communicate(timeout=60)
    assert not (broken / "t.stats.json").exists()
    told = re.search(r"interrupted: (\d+) of 30 frames of classic are finished; --resume goes on\n$", talk)
    assert (process.returncode, output) == (130, "") and told is not None, talk
    assert len(list(broken.glob("t.*.npz"))) == int(told.group(1)) >= 5
    assert not (broken / "t.mp4").exists()

    process = start(broken, variables, *LONG, "--resume")
    output, talk = process.communicate(timeout=120)
    assert (process.returncode, talk) == (0, "")
    assert names(broken) == names(whole)
    told, whole_told = (json.loads((folder / "t.stats.json").read_text()) for folder in (broken, whole))
    assert told["rendered"] < 30 == whole_told["rendered"] and len(whole_told["hits"]) == 14
    for varies in ("rendered", "seconds", "kernels", "peak_memory"):
        del told[varies], whole_told[varies]
    assert told == whole_told
    for name in names(whole):
        if name.endswith(".json"):
            continue
        if not name.endswith(".npz"):
            assert (broken / name).read_bytes() == (whole / name).read_bytes(), name
            continue
        with np.load(whole / name) as one, np.load(broken / name) as other:
            assert np.array_equal(one["color"], other["color"]), name


@pytest.mark.slow
def test_memory_does_not_grow_with_the_frames_and_kernels_are_compiled_once(tracer: Run) -> None:
    peaks = []
    for frames in ("10", "60"):
        done = tracer(
            *("turntable", "room", "--scale", "0.5", "--frames", frames, "-o", "t.npz", "--stats", "--quiet"),
            *("--set", "animation=[{key='shapes.4.radius', times=[1, 60], values=[50, 60]}]"),
        )
        assert done.returncode == 0, done.stderr
        assert re.search(r"compiled for the first frame, 0 after it", done.stdout), done.stdout
        peaks.append(int(re.search(r"peak memory +(\d+) MiB", done.stdout).group(1)))  # type: ignore[union-attr]
    assert peaks[1] < peaks[0] + 12, "a frame has 5 MiB, and 50 more were rendered"
