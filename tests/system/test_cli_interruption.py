"""Ctrl-C and SIGTERM on a real process that renders slowly."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from tracer.film.result import load_picture_file

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.name != "posix", reason="signals as on POSIX systems"),
]


@contextmanager
def slow_render(repository: Path, folder: Path, *options: str) -> Iterator[subprocess.Popen[str]]:
    """A render of more than a minute in bands of a second, in the middle of the kernel of its second band."""
    command = [sys.executable, "-m", "tracer.cli", "render", "room", "-o", "x.exr", "--progress", "json"]
    process = subprocess.Popen(
        [*command, "--supersample", "64", "--threads", "1", *options],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(repository)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stderr is not None
        assert process.stderr.readline().startswith('{"done"')
        time.sleep(0.3)
        yield process
    finally:
        process.kill()
        process.communicate()


@pytest.mark.parametrize(
    ("number", "code", "word"), [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")]
)
def test_the_finished_rows_are_kept_beside_the_picture(
    number: int, code: int, word: str, repository: Path, tmp_path: Path
) -> None:
    with slow_render(repository, tmp_path) as process:
        process.send_signal(number)
        output, talk = process.communicate(timeout=60)
    assert (process.returncode, output) == (code, "")
    assert "once more quits at once" in talk
    told = re.search(
        rf"tracer: {word}: x\.partial\.png holds what was finished of room: rows 0 to (\d+); "
        r"--crop 0 (\d+) 1024 1024 renders the others\n$",
        talk,
    )
    assert told is not None, talk
    last = int(told.group(1))
    assert int(told.group(2)) == last + 1
    assert "Traceback" not in talk
    assert [file.name for file in tmp_path.iterdir()] == ["x.partial.png"]
    picture = load_picture_file(tmp_path / "x.partial.png")
    assert picture[last].any() and not picture[last + 1 :].any()


def test_a_second_one_ends_the_process_in_the_middle_of_a_kernel(repository: Path, tmp_path: Path) -> None:
    with slow_render(repository, tmp_path, "--resolution", "2048", "1024") as process:
        process.send_signal(signal.SIGINT)
        time.sleep(0.4)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=10)
    assert process.returncode == 130
    assert not list(tmp_path.iterdir()), "the first would have left the finished rows"


def test_the_rest_completes_the_picture(repository: Path, tmp_path: Path) -> None:
    """What the message advises gives the missing rows, bit for bit."""
    command = [sys.executable, "-m", "tracer.cli", "render", "room", "--scale", "0.1", "--quiet"]
    for name, options in (("whole", []), ("rest", ["--crop", "0", "40", "102", "102"])):
        subprocess.run(
            [*command, "-o", f"{name}.npz", *options],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(repository)},
            check=True,
        )
    with np.load(tmp_path / "whole.npz") as whole, np.load(tmp_path / "rest.npz") as rest:
        assert np.array_equal(whole["color"][40:], rest["color"])
