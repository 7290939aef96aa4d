"""The command line: one file a command; this file holds only what must start fast."""

from __future__ import annotations

import sys
import time
from typing import NoReturn

STARTED = time.perf_counter()


def main() -> NoReturn:
    """Runs the command that `sys.argv` names and ends the process with its exit code."""
    try:
        from tracer.cli.app import run

        code = run(sys.argv[1:])
    except KeyboardInterrupt:
        code = 130
    sys.exit(code)
