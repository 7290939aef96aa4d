"""A long picture survives Ctrl-C, `kill -9` and a full disk: real processes, real signals, the same bytes."""

from __future__ import annotations

import json
import os
import random
import re
import signal
import subprocess
import time
from pathlib import Path

import pytest

from tests.system import under_way
from tests.system.under_way import finish
from tracer.film.work_file import MAGIC
from tracer.film.work_record import Record, record_after

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals as on POSIX systems")

KILLS = int(os.environ.get("TRACER_KILLS", "24"))
OPTIONS = (
    "--resolution",
    "256",
    "256",
    "--supersample",
    "10",
    "--threads",
    "1",
    "--aov",
    "normal",
    "--stats",
    "--aov-png",
)
"""A picture of a second or two, with two pictures of layers."""

VARIES = ("seconds", "kernels", "peak_memory")
"""Statistics that are those of a run, not of the picture."""

BAND = 256 * 32 * 36
"""Bytes of a band of 32 rows: color, coverage, depth, z and normal in single precision."""

IN_BANDS = """
from functools import partial
from tracer import cli, kept_bands
from tracer.cli import pictures
kept_bands.PATIENCE = 0
pictures.render = partial(pictures.render, rays_per_band=256 * {rows} * 10**2)
cli.main()
"""
"""The command, in bands that are kept from the first one on, however fast the machine is."""

RENDER = ("render", "classic", "-o", "x.png", "-o", "x.exr")


def start(
    repository: Path,
    folder: Path,
    *options: str,
    rows: int = 32,
    largest: int | None = None,
) -> subprocess.Popen[str]:
    """The render under way, with more options, in bands of so many rows."""
    begin = ("-c", IN_BANDS.format(rows=rows))
    return under_way.start(repository, folder, *RENDER, *OPTIONS, *options, begin=begin, largest=largest)


@pytest.fixture(scope="module")
def whole(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The files of an uninterrupted run."""
    folder = tmp_path_factory.mktemp("whole")
    assert finish(start(repository, folder)) == (0, "")
    return contents(folder)


def contents(folder: Path) -> dict[str, bytes]:
    """The files by name; of statistics what does not vary."""
    files = {
        file.name: file.read_bytes() for file in folder.iterdir() if not file.name.startswith(".tracer-")
    }
    if "x.stats.json" in files:
        told = json.loads(files["x.stats.json"])
        assert told["hits"] is not None
        steady = {key: value for key, value in told.items() if key not in VARIES}
        files["x.stats.json"] = json.dumps(steady).encode()
    return files


def until_kept(folder: Path, process: subprocess.Popen[str], bands: int = 1) -> None:
    """Waits until so many bands are in the work file."""
    while process.poll() is None:
        file = folder / "x.work"
        if file.exists() and file.stat().st_size > bands * BAND:
            return
        time.sleep(0.01)
    pytest.fail(f"the render ended: {finish(process)}")


def whole_records(file: Path) -> int:
    """How many records of a work file are whole."""
    before: Record | int = len(MAGIC)
    count, size = 0, file.stat().st_size
    with file.open("rb") as content:
        while (record := record_after(content, before, size)) is not None:
            before, count = record, count + 1
    return count


def finished_bands(talk: str) -> int:
    """How many records must be in the work file, by what a killed run in bands of 8 rows told: one for the
    settings, and one for each finished band."""
    told = [json.loads(line)["done"] for line in talk.splitlines() if line.endswith("}")]
    return 1 + told[-1] // (256 * 8) if told else 0


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_after_a_signal_the_picture_is_completed(
    number: int, repository: Path, tmp_path: Path, whole: dict[str, bytes]
) -> None:
    process = start(repository, tmp_path)
    until_kept(tmp_path, process)
    process.send_signal(number)
    code, talk = finish(process)
    assert code == 128 + number
    told = re.search(
        r"x\.partial\.png holds the finished (\d+) % of classic; the same command with --resume goes on from "
        r"x\.work\n$",
        talk,
    )
    assert told is not None and 0 < int(told.group(1)) < 100, talk
    assert sorted(contents(tmp_path)) == ["x.partial.png", "x.work"]
    process = start(repository, tmp_path, "--resume", "--progress", "json")
    code, talk = finish(process)
    assert code == 0
    first = json.loads(talk.splitlines()[0])
    assert 100 * first["done"] // first["total"] == int(told.group(1)), "all that was finished is taken over"
    assert first["rays"] == 0
    assert contents(tmp_path) == whole


@pytest.mark.slow
def test_nothing_is_lost_whenever_it_is_killed(
    repository: Path, tmp_path: Path, whole: dict[str, bytes]
) -> None:
    """Killed at random moments and resumed each time; the picture grows, and its last run gives its bytes.

    These runs keep bands from their first one on. All that a run had told to be finished are there. With the
    kills of animations (test_long_runs.py) these are 50.
    """
    times = random.Random(6)
    kills = 0
    kept = 0
    while kills < KILLS:
        process = start(repository, tmp_path, "--resume", "--progress", "json", rows=8)
        assert process.stderr is not None
        first = process.stderr.readline()  # it has begun to trace
        try:
            process.wait(times.uniform(0, 0.8))
        except subprocess.TimeoutExpired:
            process.kill()
            kills += 1
        talk = first + finish(process)[1]
        work = tmp_path / "x.work"
        assert process.returncode in (0, -signal.SIGKILL), talk
        if work.exists():
            assert whole_records(work) >= max(kept, finished_bands(talk)), "finished bands were lost"
            kept = whole_records(work)
        elif process.returncode == 0 or (tmp_path / "x.exr").exists():  # or killed when its work was done
            found = contents(tmp_path)
            if process.returncode:
                found.setdefault("x.stats.json", whole["x.stats.json"])  # which come last of all
            assert found == whole
            for file in tmp_path.iterdir():
                file.unlink()
            kept = 0
        else:
            assert kept == 0, "all finished bands were lost"
    code, talk = finish(start(repository, tmp_path, "--resume"))
    assert code == 0, talk
    assert contents(tmp_path) == whole


@pytest.mark.slow
def test_another_picture_is_refused_and_named(repository: Path, tmp_path: Path) -> None:
    process = start(repository, tmp_path)
    until_kept(tmp_path, process)
    process.kill()
    finish(process)
    before = contents(tmp_path)
    for options, name in (
        (("--set", "camera.rotate=[1, 2]"), r"camera\.rotate"),
        (("--seed", "3"), "seed"),
        (("--precision", "double"), "precision"),
        (("--supersample", "15"), "supersample"),
        (("--crop", "0", "0", "9", "9"), "crop"),
        (("--aov", "Ng"), "aov"),
    ):
        code, talk = finish(start(repository, tmp_path, "--resume", *options))
        assert code == 2
        assert re.fullmatch(rf"tracer: error: x\.work: was begun with another `{name}`: .*\n", talk), talk
        assert contents(tmp_path) == before


@pytest.mark.slow
def test_without_resume_an_old_work_file_is_dropped_and_that_is_said(
    repository: Path, tmp_path: Path, whole: dict[str, bytes]
) -> None:
    process = start(repository, tmp_path)
    until_kept(tmp_path, process)
    process.kill()
    finish(process)
    code, talk = finish(start(repository, tmp_path))
    assert code == 0
    assert talk == "tracer: x.work: is left of a run that was stopped; without --resume it is dropped\n"
    assert contents(tmp_path) == whole


@pytest.mark.slow
@pytest.mark.parametrize(
    ("room", "file"), [("1m", r"x\.work"), ("2500k", r"x\.exr")], ids=["in the middle", "at the end"]
)
def test_a_full_disk_is_one_sentence_and_the_rest_goes_on(
    room: str, file: str, repository: Path, tmp_path: Path, whole: dict[str, bytes]
) -> None:
    """The file system holds some bands, or all of them but not the pictures; then it is given more room."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={room}", "tmpfs", str(folder)]
    if subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("only root mounts a file system")
    try:
        code, talk = finish(start(repository, folder))
        assert code == 2
        assert re.fullmatch(
            rf"tracer: error: {file}: cannot be written: No space left on device; "
            r"the same command with --resume goes on from x\.work\n",
            talk,
        ), talk
        assert (folder / "x.work").stat().st_size > BAND
        subprocess.run(["mount", "-o", "remount,size=32m", str(folder)], check=True)
        code, talk = finish(start(repository, folder, "--resume", "--progress", "json"))
        assert code == 0
        done = json.loads(talk.splitlines()[0])["done"]
        assert done == 256 * 256 if file == r"x\.exr" else 0 < done < 256 * 256
        assert contents(folder) == whole
    finally:
        subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.slow
def test_a_work_file_that_may_not_grow_keeps_what_it_has(
    repository: Path, tmp_path: Path, whole: dict[str, bytes]
) -> None:
    """As on a full disk; this one needs no rights."""
    code, talk = finish(start(repository, tmp_path, largest=4 * BAND))
    assert code == 2
    assert re.fullmatch(
        r"tracer: error: x\.work: cannot be written: File too large; "
        r"the same command with --resume goes on from x\.work\n",
        talk,
    ), talk
    assert list(contents(tmp_path)) == ["x.work"]
    code, talk = finish(start(repository, tmp_path, "--resume", "--progress", "json"))
    assert code == 0
    assert json.loads(talk.splitlines()[0])["done"] == 3 * 256 * 32, "what was kept is taken over"
    assert contents(tmp_path) == whole
