"""Which frames of an animation are finished: a small file beside them, by which `--resume` goes on.

It says of which scene and settings the frames are, and of each finished frame the size and checksum of its
files, and what it took. It is replaced whole after every frame, when the frame's files are in place already.
Frames under way have work files beside it (`tracer.film.frame_work`).
"""

from __future__ import annotations

import json
import os
import re
import zlib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from tracer.errors import UsageError
from tracer.film.atomic import atomic_write
from tracer.film.frame_work import WORK_NAME

NAME = "frames.json"
_VERSION = 2
_OWN = re.compile(rf"\d{{4,}}\.png|{WORK_NAME.pattern}|\.tracer-[0-9a-f]{{16}}(\.json|\.png)")
"""Frames for movies, work files, and what a killed process left of them or of the record."""


class FrameRecord:
    """The finished frames of one animation, in a folder that also holds what else it needs until the end."""

    def __init__(self, folder: Path, made_of: Mapping[str, Any]) -> None:
        """`made_of`: plain values that decide what the frames look like, by the name users know."""
        self.folder = folder
        self.made_of = json.loads(json.dumps(made_of))
        self._frames: dict[str, dict[str, Any]] = {}

    @property
    def file(self) -> Path:
        """The record itself."""
        return self.folder / NAME

    @property
    def finished(self) -> int:
        """How many frames are finished."""
        return len(self._frames)

    def start(self, resume: bool) -> None:
        """Makes the folder and the record, or finds what is finished, if that is wanted; raises `UsageError`
        for frames of another scene or other settings, and `OutputError`."""
        if resume and self.file.exists():
            self._frames = self._read()
        else:
            self.remove()
            self.folder.mkdir(exist_ok=True)
            self._write()

    def is_done(self, frame: int, files: Sequence[Path]) -> bool:
        """Whether all these files of a frame are there as they were written."""
        try:
            entries = {name: (size, crc) for name, size, crc in self._frames[str(frame)]["files"]}
            return all(entries[self._name(file)] == _sum_of(file) for file in files)
        except (KeyError, OSError):
            return False

    def counts(self, frame: int) -> dict[str, Any]:
        """What a finished frame took."""
        return dict(self._frames[str(frame)]["counts"])

    def add(self, frame: int, files: Sequence[Path], counts: Mapping[str, Any]) -> None:
        """Notes that the files of a frame are finished, and what it took; raises `OutputError`."""
        sums = [[self._name(file), *_sum_of(file)] for file in files]
        self._frames[str(frame)] = {"files": sums, "counts": dict(counts)}
        self._write()

    def _write(self) -> None:
        content = {"version": _VERSION, "made of": self.made_of, "frames": self._frames}
        with atomic_write(self.file) as temporary:
            temporary.write_text(json.dumps(content), encoding="utf-8")

    def remove(self) -> None:
        """Removes the folder and what is ours in it; a file of another one keeps it."""
        if self.file.exists():
            for file in self.folder.iterdir():
                if _OWN.fullmatch(file.name):
                    file.unlink()
            self.file.unlink()  # last, so that the rest is not left behind
        with suppress(OSError):
            self.folder.rmdir()

    def _read(self) -> dict[str, dict[str, Any]]:
        try:
            content = json.loads(self.file.read_text(encoding="utf-8"))
            made_of, frames = content["made of"], content["frames"]
            known = content["version"] == _VERSION and isinstance(made_of, dict) and isinstance(frames, dict)
        except (OSError, ValueError, KeyError, TypeError):
            known = False
        if not known:
            raise UsageError(f"{self.file}: is no record of frames; without --resume all are rendered anew")
        for name, value in self.made_of.items():
            if made_of.get(name) != value:
                raise UsageError(
                    f"{self.file}: its frames have another {name} than what is asked for now; "
                    "without --resume they are rendered anew"
                )
        return dict(frames)

    def _name(self, file: Path) -> str:
        return os.path.relpath(os.path.realpath(file), os.path.realpath(self.folder))


def _sum_of(file: Path) -> tuple[int, int]:
    """Size and CRC-32 of a file, read piece by piece."""
    crc = 0
    with file.open("rb") as content:
        while piece := content.read(1 << 20):
            crc = zlib.crc32(piece, crc)
        return content.tell(), crc
