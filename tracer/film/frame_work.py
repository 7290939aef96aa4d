"""What of an animation is traced and not in its files yet: each frame under way has a work file.

A frame that is in its files leaves its work file to a later one, since to write over it takes a third of the
time of a new file. So there are never more of them than frames between the rays and the disk.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Collection, Mapping
from pathlib import Path
from threading import Lock
from typing import Any

from tracer.film.work_file import WorkFile

WORK_NAME = re.compile(r"(\d{1,9})\.work")


class FrameWork:
    """The work files of the frames of one animation, `1.work` and so on in its folder. A context manager: at
    its end those stay that hold a part of a frame.

    `made_of`: plain values that decide what frames look like; work on others is written over. `missing`: the
    frames that are not in their files. Raises `OutputError` for a file of such a name that is something else.
    """

    def __init__(self, folder: Path, made_of: Mapping[str, Any], missing: Collection[int]) -> None:
        self._folder = folder
        self._digest = hashlib.sha256(json.dumps(made_of).encode()).hexdigest()
        self._left: dict[int, WorkFile] = {}
        self._under_way: dict[int, WorkFile] = {}
        self._free: list[WorkFile] = []
        self._lock = Lock()
        found = [(path, int(own[1])) for path in folder.iterdir() if (own := WORK_NAME.fullmatch(path.name))]
        self._last_number = max((number for _, number in found), default=0)
        for path, _ in found:
            identity = WorkFile(path).identity() or {}
            frame: int = identity["frame"] if identity.get("made of") == self._digest else -1
            if frame in missing:
                self._left[frame] = WorkFile(path, resume=True)
            else:
                self._free.append(WorkFile(path))

    def __enter__(self) -> FrameWork:
        return self

    def __exit__(self, *_: object) -> None:
        for work in self._under_way.values():
            work.close()
        for work in self._free:
            work.remove()

    def of(self, frame: int) -> WorkFile:
        """The work file of a frame, with what an earlier run has left of it. Raises `OutputError`."""
        with self._lock:
            work = self._left.pop(frame, None) or (self._free.pop() if self._free else self._new())
            self._under_way[frame] = work
        (work.restart if work.started else work.start)(self._identity(frame))
        return work

    def release(self, frame: int) -> None:
        """The frame is in its files. For any thread."""
        with self._lock:
            self._free.append(self._under_way.pop(frame))

    def _new(self) -> WorkFile:
        self._last_number += 1
        return WorkFile(self._folder / f"{self._last_number}.work")

    def _identity(self, frame: int) -> dict[str, Any]:
        return {"frame": frame, "made of": self._digest}
