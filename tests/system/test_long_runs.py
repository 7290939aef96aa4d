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
from typing import Any

import pytest

from tests.system import under_way
from tests.system.under_way import finish
from tracer.film.work_file import MAGIC
from tracer.film.work_record import Record, record_after

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.name != "posix", reason="signals and limits as on POSIX systems"),
]

KILLS = int(os.environ.get("TRACER_KILLS", "26"))
SIZE = (128, 96)
TURN = ("turntable", "classic", "--scale", "0.1", "--frames", "24", "-o", "t.mp4", "-o", "t.png")

IN_BANDS = """
from functools import partial
from tracer import cli
from tracer.cli import animation_run
animation_run.render = partial(animation_run.render, rays_per_band=128 * 32 * 9)
cli.main()
"""
"""The command, with three bands a frame."""

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


def on_disk(folder: Path, record: Path) -> tuple[int, int]:
    """Pixels of the frames that the record names, and those with the bands of others in work files."""
    frames = json.loads(record.read_text())["frames"]
    finished = pixels = len(frames) * SIZE[0] * SIZE[1]
    for file in folder.glob("*.work"):
        frame, labels = whole_records(file)
        if str(frame) not in frames:
            bands = [label["band"] for label in labels]
            pixels += sum((x1 - x0) * (y1 - y0) for x0, y0, x1, y1 in bands)
    return finished, pixels


def whole_records(file: Path) -> tuple[int | None, list[dict[str, Any]]]:
    """Of which frame a work file is, and the labels of the bands in it."""
    before: Record | int = len(MAGIC)
    labels = []
    with file.open("rb") as content:
        while (record := record_after(content, before, file.stat().st_size)) is not None:
            labels.append(record.label)
            before = record
    return (labels[0]["frame"], labels[1:]) if labels else (None, [])


def test_animations_killed_at_random_lose_the_band_in_hand(start: Start, tmp_path: Path) -> None:
    """All that a run had told to be finished is there: as a frame, or as bands of it in a work file."""
    assert finish(start(*TURN)) == (0, "")
    whole = emptied(tmp_path)
    record, times, kills, kept, finished = tmp_path / "t.frames" / "frames.json", random.Random(6), 0, 0, 0
    while kills < KILLS:
        process = start(*TURN, "--resume", "--progress", "json", begin=("-c", IN_BANDS))
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
            told = json.loads(lines[-1])["done"] if lines else 0
            finished_now, kept_now = on_disk(tmp_path / "t.frames", record)
            assert kept_now >= max(kept, finished + told), "finished bands were lost"
            frames = finished_now // (SIZE[0] * SIZE[1])
            assert len(list(tmp_path.glob("t.*.png"))) <= frames + 1, "the last one may lack its line"
            kept, finished = kept_now, finished_now
        elif (tmp_path / "t.mp4").exists():  # it may have been killed after its work was done
            assert emptied(tmp_path) == whole
            kept = finished = 0
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


CRAMPED_MOVIE = """
import resource
from tracer import cli
from tracer.cli import animation_run

def cramped(*arguments):
    resource.setrlimit(resource.RLIMIT_FSIZE, (40000, 40000))
    write_movie(*arguments)

write_movie, animation_run.write_movie = animation_run.write_movie, cramped
cli.main()
"""
"""The command, with room for frames of any size, and little for their movie."""

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
            r"f\.frames/1\.work: cannot be written: File too large; 0 of 6 frames are finished, "
            "--resume goes on",
            [],
        ),
        (
            (*FRAMES, "-o", "f.gif"),
            None,
            r"f\.gif: ffmpeg could not write it: .+; 6 of 6 frames are finished, --resume goes on",
            [],
        ),
    ],
    ids=["png", "exr", "frame", "movie"],
)
def test_a_file_that_does_not_fit_is_one_sentence(
    command: Sequence[str],
    largest: int | None,
    sentence: str,
    left: list[str],
    start: Start,
    tmp_path: Path,
) -> None:
    """With room for smaller files only, in the end where none is named; then with all the room it needs, and
    --resume."""
    assert finish(start(*command))[0] == 0
    whole = emptied(tmp_path)
    begin = ("-c", CRAMPED_MOVIE) if largest is None else under_way.COMMAND
    code, talk = finish(start(*command, begin=begin, largest=largest))
    assert code == 2
    assert re.fullmatch(rf"tracer: error: {sentence}\n", talk), talk
    assert sorted(contents(tmp_path)) == left
    assert not any(tmp_path.glob(".tracer-*"))
    assert finish(start(*command, "--resume", "--quiet"))[0] == 0
    assert contents(tmp_path) == whole
