"""A command in a process of its own, to be interrupted, killed or starved of disk."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

COMMAND = ("-m", "tracer.cli")
AT_ONCE = ("-c", "from tracer import cli, kept_bands; kept_bands.PATIENCE = 0; cli.main()")
"""The command, which keeps bands from the first one on, however fast the machine is."""


def start(
    repository: Path,
    folder: Path,
    *arguments: str,
    begin: Sequence[str] = COMMAND,
    largest: int | None = None,
) -> subprocess.Popen[str]:
    """`tracer` under way in a folder; SIGINT does what it does at a terminal, however the tests were started.
    `begin`: what Python runs in its place; `largest`: bytes of a file, from which on writing fails."""

    def prepare() -> None:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        if largest is not None:
            import resource

            resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest))

    return subprocess.Popen(
        [sys.executable, *begin, *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(repository)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=prepare,
    )


def finish(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Exit code and stderr."""
    _, talk = process.communicate(timeout=120)
    return process.returncode, talk
