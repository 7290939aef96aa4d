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

import pytest

from tracer.cli.interruption import SAME_REQUEST
from tracer.film.result import load_picture_file

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.name != "posix", reason="signals as on POSIX systems"),
]


SLOW = ("--resolution", "256", "192", "--supersample", "64", "--threads", "1", "--set", "lights.0.samples=64")
"""96 bands of 64 x 8 pixels, of more than a second each."""

LONGER = ("--set", "lights.0.samples=192")
"""Bands of thrice that time, in which there is room for two signals on a faster machine as well."""


@contextmanager
def slow_render(repository: Path, folder: Path, *options: str) -> Iterator[subprocess.Popen[str]]:
    """A render of more than a minute, in the middle of the kernel of its second band."""
    command = [sys.executable, "-m", "tracer.cli", "render", "classic", "-o", "x.exr", "--progress", "json"]
    process = subprocess.Popen(
        [*command, *SLOW, *options],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(repository)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stderr is not None
        for _ in range(2):  # at the start, after the first band
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
        rf"tracer: {word}: x\.partial\.png holds the finished (\d+) % of classic; "
        r"the same command with --resume goes on from x\.work\n$",
        talk,
    )
    assert told is not None, talk
    percent = int(told.group(1))
    assert 0 < percent < 100
    assert "Traceback" not in talk
    assert sorted(file.name for file in tmp_path.iterdir()) == ["x.partial.png", "x.work"]
    picture = load_picture_file(tmp_path / "x.partial.png")
    row = len(picture) * percent // 100
    assert picture[row // 8 * 8].any() and not picture[row + 16 :].any()


def test_a_second_one_ends_the_process_in_the_middle_of_a_kernel(repository: Path, tmp_path: Path) -> None:
    with slow_render(repository, tmp_path, *LONGER) as process:
        process.send_signal(signal.SIGINT)
        assert process.stderr is not None
        while "once more quits at once" not in process.stderr.readline():
            assert process.poll() is None
        time.sleep(1.2 * SAME_REQUEST)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    assert process.returncode == 130
    assert not (tmp_path / "x.partial.png").exists(), "the first alone would have left it"
