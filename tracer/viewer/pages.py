"""One open page: what is still to be sent to it, and in which order."""

from __future__ import annotations

import asyncio
import json
from collections import deque
from collections.abc import Awaitable, Callable
from typing import Any

from tracer.viewer.frames import Frame

FRAMES_UNDER_WAY = 2
"""Frames sent and not yet drawn: while one is drawn, the next is rendered."""

Described = Callable[[], dict[str, Any]]


class Page:
    """What is old on a page is sent anew, as `panel` and `values` give it then; of frames only the newest."""

    def __init__(self, panel: Described, values: Described) -> None:
        self._panel, self._values = panel, values
        self._under_way = 0
        self._notices: deque[dict[str, Any]] = deque()
        self.frame: Frame | None = None
        self.panel_is_old = self.values_are_old = True
        self.heard = 0.0  # stamp of the last change that it asked for
        self.complaints = 0
        self.work = asyncio.Event()

    @property
    def is_ready(self) -> bool:
        """Whether it waits for a frame."""
        return self._under_way + (self.frame is not None) < FRAMES_UNDER_WAY

    def drew(self) -> None:
        """It has drawn a frame."""
        self._under_way = max(0, self._under_way - 1)
        self.work.set()

    def notify(self, notice: dict[str, Any]) -> None:
        """Something that is sent once, in order."""
        self._notices.append(notice)
        self.work.set()

    async def serve(
        self, send_text: Callable[[str], Awaitable[None]], send_bytes: Callable[[bytes], Awaitable[None]]
    ) -> None:
        """Sends what there is, until the page is closed."""
        while True:
            await self.work.wait()
            self.work.clear()
            if self.panel_is_old:
                self.panel_is_old = False
                await send_text(json.dumps({"kind": "panel", **self._panel()}))
            if self.values_are_old:
                self.values_are_old = False
                await send_text(json.dumps({"kind": "values", "heard": self.heard, **self._values()}))
            while self._notices:
                await send_text(json.dumps(self._notices.popleft()))
            if self.frame is not None and self._under_way < FRAMES_UNDER_WAY:
                frame, self.frame = self.frame, None
                self._under_way += 1
                await send_bytes(frame.message())
