"""The renderer's thread: the view that is wanted now, first as a draft, then sharper and sharper.

One thing at a time, always the newest: a view that nobody waits for any more is dropped, between two frames
and, while a picture is being sharpened, between two bands. Nothing is rendered while nobody is ready to look.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from tracer.backends import thread_count
from tracer.errors import TracerError
from tracer.viewer.frames import Frame
from tracer.viewer.memory import KernelBound, give_back
from tracer.viewer.pace import Pace
from tracer.viewer.pictures import Dropped, Pictures
from tracer.viewer.session import Session
from tracer.viewer.stages import Stage, stages_of
from tracer.viewer.state import View

SETTLED = 0.25
"""Seconds without a change after which the picture is sharpened."""

IDLE = 1.0
"""Seconds after which a thread that waits looks around, without need."""

logger = logging.getLogger("tracer.viewer")

T = TypeVar("T")


class Renderer:
    """Makes pictures of what a session wants to show, and does what else needs the kernels.

    `publish` is called in the renderer's thread with every frame and `fail` with the text of what went wrong;
    `ready` says whether anybody waits for a frame, and is asked again after `wake`.
    """

    def __init__(
        self,
        session: Session,
        publish: Callable[[Frame], None],
        fail: Callable[[str], None],
        ready: Callable[[], bool],
        backend: str = "auto",
        threads: int | None = None,
    ) -> None:
        self._session, self._publish, self._fail, self._ready = session, publish, fail, ready
        self._threads = threads
        self._pictures = Pictures(session.view.scene, backend)
        self._kernels = KernelBound()
        self._pace = Pace()
        self._changed = threading.Condition()
        self._tasks: deque[tuple[Callable[[], Any], Future[Any]]] = deque()
        self._stopped = False
        self._thread = threading.Thread(target=self._run, name="renderer", daemon=True)
        self.dropped = 0
        self._drawing = 0.0  # seconds that the page takes for a frame
        session.on_change = self.wake

    def start(self) -> None:
        """Begins to render."""
        self._thread.start()

    def stop(self) -> None:
        """Ends the thread after the band in hand."""
        self._stopped = True
        self.wake()
        self._thread.join(timeout=10)

    def wake(self) -> None:
        """Something has changed: the view, or who looks at it."""
        with self._changed:
            self._changed.notify_all()

    def do(self, task: Callable[[], T]) -> Future[T]:
        """Runs a task between two frames, in the thread that owns the kernels."""
        future: Future[T] = Future()
        self._tasks.append((task, future))
        self.wake()
        return future

    def drawn(self, seconds: float) -> None:
        """A page has shown a frame, which took it so long, and waits for the next one."""
        self._drawing += 0.2 * (min(max(seconds, 0.0), 1.0) - self._drawing)
        self.wake()

    # ---- The thread ----

    def _run(self) -> None:
        with thread_count(self._threads):
            self._pictures.prepare()
            stages: list[Stage] = []
            revision = -1
            while not self._stopped:
                self._do_tasks()
                self._kernels.keep()
                view = self._session.view
                if not self._ready():
                    self._wait(view, IDLE, self._ready)
                    continue
                if view.revision != revision:
                    revision, stages = view.revision, stages_of(view, self._pace.scale)
                elif not self._settled(view):
                    continue
                if not stages:
                    self._wait(view, IDLE)
                elif self._show(view, stages[0]):
                    del stages[0]

    def _do_tasks(self) -> None:
        while self._tasks:
            task, future = self._tasks.popleft()
            try:
                future.set_result(task())
            except BaseException as error:  # noqa: B036 - whoever asked for it is told
                future.set_exception(error)

    def _settled(self, view: View) -> bool:
        """Whether the view has been at rest long enough; else waits until it has, or something happens."""
        remaining = view.changed + SETTLED - time.monotonic()
        if remaining > 0:
            self._wait(view, remaining)
        return remaining <= 0

    def _wait(self, view: View, seconds: float, until: Callable[[], bool] = lambda: False) -> None:
        """Waits until another view is wanted, or a task is there, or that is true, or the time is up."""
        with self._changed:
            if not (self._stopped or self._tasks or self._session.view is not view or until()):
                self._changed.wait(seconds)

    def _show(self, view: View, stage: Stage) -> bool:
        """Makes a picture and publishes it; False where it was given up."""
        try:
            frame = self._pictures.frame(view, stage, lambda: self._is_wanted(view))
        except Dropped:
            self.dropped += 1
            return False
        except TracerError as error:
            self._fail(str(error))
            return True
        except Exception as error:  # the thread must outlive it: the next view may do
            logger.error("a picture failed: unexpected %s: %s", type(error).__name__, error)
            self._fail(f"unexpected {type(error).__name__}: {error}")
            return True
        self._publish(frame)
        if stage.is_final:
            give_back()
        if stage.is_draft:
            self._pace.took(stage.scale, sum(frame.seconds.values()) + self._drawing)
        return True

    def _is_wanted(self, view: View) -> bool:
        return not (self._stopped or self._tasks) and self._session.view is view
