"""Animations and files that meet kills, Ctrl-C and full disks: one sentence, no half file, and the same bytes
in the end."""

from __future__ import annotations

import json
import os
import random
import re
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import pytest

from tests.system import under_way
from tests.system.under_way import finish

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.name != "posix", reason="signals and limits as on POSIX systems"),
]

KILLS = int(os.environ.get("TRACER_KILLS", "26"))
SIZE = (128, 96)
TURN = ("turntable", "classic", "--scale", "0.1", "--frames", "24", "-o", "t.mp4", "-o", "t.png")
IN_HAND = 3
"""Frames that a kill may cost beside the one being traced: traced just now, waiting, being written."""

Start = Callable[..., subprocess.Popen[str]]


@pytest.fixture
def start(repository: Path, tmp_path: Path) -> Start:
    """Starts `tracer` in the folder of the test."""
    return partial(under_way.start, repository, tmp_path)


def contents(folder: Path) -> dict[str, bytes]:
    """Files by name. A process that is killed leaves the temporary file it was writing: no other may remove
    it."""
    files = (file for file in folder.iterdir() if file.is_file() and not file.name.startswith(".tracer-"))
    return {file.name: file.read_bytes() for file in files}


def emptied(folder: Path) -> dict[str, bytes]:
    """What was in a folder."""
    found = contents(folder)
    for file in folder.iterdir():
        if file.is_dir():
            file.rmdir()
        else:
            file.unlink()
    return found


def test_animations_killed_at_random_lose_the_frames_in_hand(start: Start, tmp_path: Path) -> None:
    assert finish(start(*TURN)) == (0, "")
    whole = emptied(tmp_path)
    record, times, kills, kept = tmp_path / "t.frames" / "frames.json", random.Random(6), 0, 0
    while kills < KILLS:
        process = start(*TURN, "--resume", "--progress", "json")
        assert process.stderr is not None
        first = process.stderr.readline()  # it has begun to trace, or has no more to trace
        try:
            process.wait(times.uniform(0, 0.6))
        except subprocess.TimeoutExpired:
            process.kill()
            kills += 1
        code, talk = finish(process)
        talk = first + talk
        assert code in (0, -signal.SIGKILL)
        if record.exists():
            lines = [line for line in talk.splitlines() if line.endswith("}")]
            traced = json.loads(lines[-1])["done"] // (SIZE[0] * SIZE[1]) if lines else 0
            found = len(json.loads(record.read_text())["frames"])
            assert found >= max(kept, kept + traced - IN_HAND), "finished frames were lost"
            assert len(list(tmp_path.glob("t.*.png"))) <= found + 1, "the last one may lack its line"
            kept = found
        elif (tmp_path / "t.mp4").exists():  # it may have been killed after its work was done
            assert emptied(tmp_path) == whole
            kept = 0
        else:
            assert code != 0 and kept == 0, "all finished frames were lost"
    code, _ = finish(start(*TURN, "--resume"))
    assert code == 0
    assert contents(tmp_path) == whole


def test_ctrl_c_and_kill_during_a_movie(start: Start, tmp_path: Path) -> None:
    movie = (*TURN[:-4], "-o", "t.webm", "--resolution", "320", "240")
    assert finish(start(*movie)) == (0, "")
    whole = emptied(tmp_path)
    for number, code in ((signal.SIGINT, 130), (signal.SIGKILL, -signal.SIGKILL)):
        process = start(*movie, "--resume")
        while process.poll() is None and not any(tmp_path.glob(".tracer-*.webm")):
            time.sleep(0.002)
        process.send_signal(number)
        found, talk = finish(process)
        assert found == code, "it was stopped in its movie"
        assert contents(tmp_path) == {}, "no half movie"
        if number == signal.SIGINT:
            assert "all 24 frames of classic are finished, its movie is not; --resume goes on\n" in talk
            assert not any(tmp_path.glob(".tracer-*"))
    process = start(*movie, "--resume", "--progress", "json")
    output, talk = process.communicate(timeout=120)
    assert (process.returncode, talk) == (0, "") and "24 frames (24 were finished before)" in output
    assert contents(tmp_path) == whole


PICTURE = ("render", "room", "--resolution", "160", "120")
FRAMES = ("turntable", "room", "--resolution", "160", "120", "--frames", "6")


@pytest.mark.parametrize(
    ("command", "largest", "sentence", "left"),
    [
        ((*PICTURE, "-o", "p.png"), 4000, r"p\.png: cannot be written: File too large", []),
        (
            (*PICTURE, "-o", "p.png", "-o", "p.exr"),
            40000,
            r"p\.exr: cannot be written: File too large",
            ["p.png"],
        ),
        (
            (*FRAMES, "-o", "f.png"),
            4000,
            r"f\.0001\.png: cannot be written: File too large; 0 of 6 frames are finished, --resume goes on",
            [],
        ),
        (
            (*FRAMES, "-o", "f.gif"),
            40000,
            r"f\.gif: ffmpeg could not write it: .+; 6 of 6 frames are finished, --resume goes on",
            [],
        ),
    ],
    ids=["png", "exr", "frame", "movie"],
)
def test_a_file_that_does_not_fit_is_one_sentence(
    command: Sequence[str], largest: int, sentence: str, left: list[str], start: Start, tmp_path: Path
) -> None:
    """With room for smaller files only; then with all the room it needs, and --resume."""
    assert finish(start(*command))[0] == 0
    whole = emptied(tmp_path)
    code, talk = finish(start(*command, largest=largest))
    assert code == 2
    assert re.fullmatch(rf"tracer: error: {sentence}\n", talk), talk
    assert sorted(contents(tmp_path)) == left
    assert not any(tmp_path.glob(".tracer-*"))
    assert finish(start(*command, "--resume", "--quiet"))[0] == 0
    assert contents(tmp_path) == whole
