"""The renderer's thread: the view that is wanted now, first as a draft, then sharper and sharper.

One thing at a time, always the newest: a view that nobody waits for any more is dropped, between two frames
and, while a picture is being sharpened, between two bands. Nothing is rendered while nobody is ready to look.
"""

from __future__ import annotations

import itertools
import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from tracer.backends import thread_count
from tracer.errors import TracerError
from tracer.film.result import Result
from tracer.render import render
from tracer.viewer.drafts import compile_copies, compile_filters, draft_of
from tracer.viewer.frames import DRAFT_QUALITY, STILL_QUALITY, Frame, compressed
from tracer.viewer.layers import aovs_of, picture_of
from tracer.viewer.pace import Pace
from tracer.viewer.session import Session
from tracer.viewer.stages import Stage, stages_of
from tracer.viewer.state import View

SETTLED = 0.25
"""Seconds without a change after which the picture is sharpened."""

IDLE = 1.0
"""Seconds after which a thread that waits looks around, without need."""

RAYS_PER_BAND = 1 << 17
"""Primary rays of a launch while a picture is sharpened: soon given up when something moves."""

logger = logging.getLogger("tracer.viewer")

T = TypeVar("T")


class _Dropped(Exception):
    """Nobody waits for this picture any more."""


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
        self._backend, self._threads = backend, threads
        self._start = session.view.scene
        self._pace = Pace()
        self._changed = threading.Condition()
        self._tasks: deque[tuple[Callable[[], Any], Future[Any]]] = deque()
        self._stopped = False
        self._numbers = itertools.count(1)
        self._thread = threading.Thread(target=self._run, name="renderer", daemon=True)
        self.dropped = 0
        self._has_filters = False
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
            compile_copies(self._backend)
            stages: list[Stage] = []
            revision = -1
            while not self._stopped:
                self._do_tasks()
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

    # ---- Pictures ----

    def _show(self, view: View, stage: Stage) -> bool:
        """Renders a stage and publishes it; False where it was given up."""
        try:
            self._prepare(view)
            started = time.perf_counter()
            result = self._rendered(view, stage)
        except _Dropped:
            self.dropped += 1
            return False
        except TracerError as error:
            self._fail(str(error))
            return True
        except Exception as error:  # the thread must outlive it: the next view may do
            logger.error("a picture failed: unexpected %s: %s", type(error).__name__, error)
            self._fail(f"unexpected {type(error).__name__}: {error}")
            return True
        rendered = time.perf_counter()
        image = picture_of(view.layer, result, legend=not stage.is_draft)
        jpeg = compressed(image, DRAFT_QUALITY if stage.is_draft else STILL_QUALITY)
        done = time.perf_counter()
        height, width = image.shape[:2]
        self._publish(
            Frame(
                number=next(self._numbers),
                revision=view.revision,
                stamp=view.stamp,
                layer=view.layer,
                width=width,
                height=height,
                scale=stage.scale,
                supersample=stage.supersample,
                final=stage.is_final,
                depth=float(result.depth[height // 2, width // 2]),
                seconds={"render": rendered - started, "compress": done - rendered},
                jpeg=jpeg,
            )
        )
        if stage.is_draft:
            self._pace.took(stage.scale, done - started + self._drawing)
        return True

    def _prepare(self, view: View) -> None:
        """Compiles what moving the focus will need, when depth of field is on for the first time."""
        if view.scene.camera.depth_of_field is not None and not self._has_filters:
            self._has_filters = True
            compile_filters(view.scene, self._backend)

    def _rendered(self, view: View, stage: Stage) -> Result:
        def progress(*_: int) -> None:
            if not stage.is_draft and (self._stopped or self._tasks or self._session.view is not view):
                raise _Dropped

        return render(
            draft_of(view.scene, self._start) if stage.is_draft else view.scene,
            backend=self._backend,
            supersample=stage.supersample,
            aovs=("depth", *aovs_of(view.layer)),
            scale=stage.scale,
            rays_per_band=RAYS_PER_BAND if stage.supersample > 1 else 1 << 21,
            progress=progress,
        )
