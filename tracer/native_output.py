"""Keeps C libraries (libpng, libjpeg, OpenEXR) from writing to the terminal of the user by themselves."""

from __future__ import annotations

import os
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_one_at_a_time = threading.Lock()


@contextmanager
def captured_stderr() -> Iterator[Callable[[], str]]:
    """Sends the process's stderr (file descriptor 2) to a temporary file; gives a function that reads it.

    Meant for single calls into a library: what another thread writes meanwhile is captured too.
    """
    with _one_at_a_time, tempfile.TemporaryFile() as capture:
        if sys.stderr is not None:
            sys.stderr.flush()
        try:
            saved = os.dup(2)
        except OSError:  # a process without stderr has nothing to be kept quiet
            yield lambda: ""
            return
        os.dup2(capture.fileno(), 2)
        try:
            yield lambda: _text(capture.fileno())
        finally:
            os.dup2(saved, 2)
            os.close(saved)


def _text(descriptor: int) -> str:
    os.lseek(descriptor, 0, os.SEEK_SET)
    chunks = iter(lambda: os.read(descriptor, 1 << 16), b"")
    return b"".join(chunks).decode(errors="replace")
