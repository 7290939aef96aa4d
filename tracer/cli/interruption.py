"""Ctrl-C and SIGTERM: the first ends the work tidily, the second ends the process at once.

While a picture is being traced, Ctrl-C waits for the end of the band: an exception in the middle of a Dr.Jit
loop would come out as another error, and the finished rows would be lost. Python runs a signal's handler only
between two of its own steps, never during a kernel; so a thread that its C part wakes at once counts them.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM)
SAME_REQUEST = (
    0.3  # seconds; `timeout` and some shells send one request twice, to the process and to its group
)


class Interruption:
    """Whether the user wants to stop. Used as a context manager; it handles signals inside."""

    def __init__(self) -> None:
        self.requested = 0  # number of the signal
        self.quiet = False
        self._deferred = False
        self._before: dict[signal.Signals, Any] = {}
        self._pipe: tuple[int, int] | None = None

    @property
    def exit_code(self) -> int:
        """130 after Ctrl-C, 143 after SIGTERM."""
        return 128 + (self.requested or signal.SIGINT)

    @property
    def reason(self) -> str:
        """The word for messages."""
        return "terminated" if self.requested == signal.SIGTERM else "interrupted"

    @contextmanager
    def deferred(self) -> Iterator[None]:
        """Inside, a signal is only noted; `check` raises."""
        self.check()
        self._deferred = True
        try:
            yield
        finally:
            self._deferred = False

    def check(self) -> None:
        """Raises KeyboardInterrupt when the user wants to stop."""
        if self.requested:
            raise KeyboardInterrupt

    def __enter__(self) -> Interruption:
        if threading.current_thread() is not threading.main_thread():
            return self
        for number in SIGNALS:
            if signal.getsignal(number) is not signal.SIG_IGN:  # a job in the background is not to be stopped
                self._before[number] = signal.signal(number, self._handle)
        if os.name == "posix":
            self._pipe = os.pipe()
            os.set_blocking(self._pipe[1], False)
            signal.set_wakeup_fd(self._pipe[1], warn_on_full_buffer=False)
            threading.Thread(target=self._watch, args=(self._pipe[0],), daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        if self._pipe is not None:
            signal.set_wakeup_fd(-1)
            os.close(self._pipe[1])  # ends the thread

    def _handle(self, number: int, _: FrameType | None) -> None:
        again, self.requested = bool(self.requested), self.requested or number
        if not self._deferred and not again:
            raise KeyboardInterrupt

    def _watch(self, pipe: int) -> None:
        first = 0.0
        while received := os.read(pipe, 1):
            number = received[0]
            if number not in self._before:
                continue
            if not first:
                first = time.monotonic()
                self._say_that_it_waits()
            elif time.monotonic() - first > SAME_REQUEST:
                os._exit(128 + number)
        os.close(pipe)

    def _say_that_it_waits(self) -> None:
        if self._deferred and not self.quiet:
            os.write(2, b"\ntracer: stopping after the work in hand; once more quits at once\n")
