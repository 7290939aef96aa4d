"""Between the pages and the session: what a page says is done, what it must know is sent to it.

Everything here runs in the event loop of the server, but for what the renderer's thread hands over.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from typing import Any

from tracer.errors import TracerError, UsageError
from tracer.messages import suggestion
from tracer.scene import Scene
from tracer.viewer import comparison, layers, lens, messages
from tracer.viewer.frames import Frame
from tracer.viewer.pages import Page
from tracer.viewer.renderer import Renderer
from tracer.viewer.saving import Folder
from tracer.viewer.session import Session

MOST_COMPLAINTS = 20
"""Refused messages of one page that are logged one by one."""

logger = logging.getLogger("tracer.viewer")


class Hub:
    """The pages that are open, and what they do to the session."""

    def __init__(self, session: Session, folder: Folder, backend: str, threads: int | None) -> None:
        self.session, self._folder, self._backend = session, folder, backend
        self._pages: set[Page] = set()
        self._loop = asyncio.get_running_loop()
        self._last: Frame | None = None
        self.renderer = Renderer(
            session,
            self._from_thread(self._deliver),
            self._from_thread(self._tell),
            self._is_ready,
            backend,
            threads,
        )

    def _from_thread(self, function: Callable[[Any], None]) -> Callable[[Any], None]:
        def later(value: Any) -> None:
            if not self._loop.is_closed():
                self._loop.call_soon_threadsafe(function, value)

        return later

    def _is_ready(self) -> bool:
        return any(page.is_ready for page in tuple(self._pages))

    # ---- To the pages ----

    def join(self) -> Page:
        """A page was opened."""
        page = Page(self.described, self.session.values)
        page.frame = self._last
        page.work.set()
        self._pages.add(page)
        self.renderer.wake()
        return page

    def leave(self, page: Page) -> None:
        """A page was closed."""
        self._pages.discard(page)

    def _deliver(self, frame: Frame) -> None:
        self._last = frame
        for page in self._pages:
            page.frame = frame
            page.work.set()

    def _tell(self, text: str) -> None:
        for page in self._pages:
            page.notify({"kind": "notice", "text": text})

    def _everything_is_old(self, panel: bool = False) -> None:
        for page in self._pages:
            page.values_are_old = True
            page.panel_is_old |= panel
            page.work.set()

    def described(self) -> dict[str, Any]:
        """What a page must know to build its panel."""
        return {
            **self.session.described(),
            "layers": layers.names_of(self.session.view.scene),
            "comparison": comparison.is_available(),
        }

    # ---- From a page ----

    def hear(self, page: Page, text: str | bytes) -> None:
        """Does what a page says; one that is refused is logged and does nothing, and the page is told why."""
        try:
            self._do(page, messages.parse(text))
        except TracerError as error:
            page.notify({"kind": "notice", "text": str(error)})
            self._complain(page, str(error))

    def _complain(self, page: Page, text: str) -> None:
        page.complaints += 1
        if page.complaints <= MOST_COMPLAINTS:
            last = "; further ones of this page are not logged" if page.complaints == MOST_COMPLAINTS else ""
            logger.warning("a message was refused: %s%s", " ".join(text.split()), last)

    def _do(self, page: Page, message: Any) -> None:
        session = self.session
        match message:
            case messages.Ack():
                page.drew()
                self.renderer.drawn(message.seconds)
                return
            case messages.Grab():
                session.grab(self._depth)
                return
            case messages.Look() | messages.SaveScene() | messages.SaveStill() | messages.Compare():
                self._answer(page, message, session.view.scene)
                return
        controls = session.controls
        page.heard = message.stamp
        try:
            self._change(message)
        finally:
            self._everything_is_old(panel=session.controls is not controls)

    @property
    def _depth(self) -> float:
        return -1.0 if self._last is None else self._last.depth

    def _change(self, message: Any) -> None:
        session, stamp, gesture = self.session, message.stamp, message.gesture
        match message:
            case messages.Orbit():
                session.orbit(message.left, message.up, gesture, stamp)
            case messages.Pan():
                session.pan(message.right, message.down, gesture, stamp)
            case messages.Dolly():
                session.dolly(message.share, gesture, stamp)
            case messages.Rotate():
                session.rotate(message.x_rotate, message.y_rotate, gesture, stamp)
            case messages.Move():
                session.shift(message.by, gesture, stamp)
            case messages.Set():
                session.set(message.name, message.value, gesture, stamp)
            case messages.Paint():
                session.paint(message.name, message.color, gesture, stamp)
            case messages.Choose():
                session.choose(message.name, message.value, stamp)
            case messages.Focus():
                session.switch_focus(message.value, self._depth, stamp)
            case messages.Show():
                known = dict(layers.names_of(session.view.scene))
                if message.layer not in known:
                    hint = suggestion(message.layer, known, "layer")
                    raise UsageError(f"there is no layer {message.layer[:80]!r}; {hint}")
                session.show(message.layer, stamp)
            case messages.Reset():
                session.reset_camera(stamp)
            case messages.Reload():
                session.reload(stamp)
            case messages.Undo():
                session.undo(stamp)

    def _answer(self, page: Page, message: Any, scene: Scene) -> None:
        """Has the renderer's thread do what needs kernels, and sends what comes of it."""
        column, row = 0, 0
        if isinstance(message, messages.Look):
            width, height = scene.camera.resolution
            column, row = min(int(message.x * width), width - 1), min(int(message.y * height), height - 1)

        def task() -> dict[str, Any]:
            match message:
                case messages.Look():
                    return {"kind": "tree", **lens.looked_at(scene, column, row, self._backend)}
                case messages.SaveScene():
                    return {"kind": "saved", "file": self._folder.save_scene(scene).name}
                case messages.SaveStill():
                    file = self._folder.save_still(scene, message.suffix, self._backend)
                    return {"kind": "saved", "file": file.name}
            return {"kind": "compared", **comparison.compared(scene, self._backend)}

        self.renderer.do(task).add_done_callback(self._from_thread(lambda done: self._finish(page, done)))

    def _finish(self, page: Page, future: Any) -> None:
        error = future.exception()
        if error is None:
            page.notify(future.result())
        elif isinstance(error, TracerError):
            page.notify({"kind": "notice", "text": str(error)})
        else:
            logger.error("unexpected %s: %s", type(error).__name__, error)
            page.notify({"kind": "notice", "text": f"unexpected {type(error).__name__}: {error}"})
