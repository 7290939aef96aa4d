"""Frames are written beside the tracing of the next one: kernels and compression both run without Python."""

from __future__ import annotations

import threading
from collections.abc import Callable
from queue import Queue
from types import TracebackType

from tracer.film.result import Result

Save = Callable[[int, Result], None]


class FrameWriter:
    """A thread that saves one frame after the other. One waits at most, so memory does not grow with their
    number. Used as a context manager, at whose end everything is written, or the first error is raised."""

    def __init__(self, save: Save) -> None:
        self._save = save
        self._queue: Queue[tuple[int, Result] | None] = Queue(maxsize=1)
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._work, name="frame writer")

    def write(self, frame: int, result: Result) -> None:
        """Hands over a frame; waits while another one does. Raises what an earlier one met."""
        if self._error is not None:
            raise self._error
        self._queue.put((frame, result))

    def __enter__(self) -> FrameWriter:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._queue.put(None)
        self._thread.join()
        if error is None and self._error is not None:
            raise self._error

    def _work(self) -> None:
        while (entry := self._queue.get()) is not None:
            if self._error is None:
                try:
                    self._save(*entry)
                except BaseException as error:  # raised again where it is seen
                    self._error = error
