"""A work file keeps what a long job has finished, so that nothing is lost when the job is stopped.

It stands beside the output while the job is under way. Finished pieces are appended to it, each a label (any
JSON) and arrays by name; after Ctrl-C, `kill -9` or a full disk the next run finds them again:

    work = WorkFile("out/a.work", resume=True)
    work.start({"frames": "0:120", "camera.fov": 40})   # what must be the same, else UsageError names it
    done = {label["frame"]: arrays["color"] for label, arrays in work.records()}
    work.keep({"frame": 12}, {"color": color})
    work.remove()                                       # when the output is written

A record begins with the lengths of its label and of its arrays and with their checksum. So a record that was
cut short by a crash is recognized; it is dropped, and the file goes on after the last whole one. All that
`keep` has written survives the process; what a power failure leaves is at most `SYNC_SECONDS` old.
"""

from __future__ import annotations

import json
import os
import struct
import time
import zlib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

import numpy as np

from tracer.errors import OutputError, UsageError
from tracer.messages import show

MAGIC = b"tracer work file 1\n"
SYNC_SECONDS = 10.0

_HEAD = struct.Struct(
    "<QQI"
)  # bytes of the label, bytes of the arrays, CRC-32 of both lengths and both parts
_LONGEST_LABEL = 1 << 28
_CHUNK = 1 << 24

Label = dict[str, Any]


class WorkFile:
    """See the module. `resume`: go on with what the file holds; otherwise it is begun anew."""

    def __init__(self, path: str | os.PathLike[str], resume: bool = False) -> None:
        self.path, self.resume = Path(path), resume
        self.started = False
        self._file: IO[bytes] | None = None
        self._places: list[tuple[Label, int]] = []  # label and where its arrays begin
        self._end = 0
        self._synced = time.monotonic()

    def exists(self) -> bool:
        """Whether an earlier run left a work file; raises `OutputError` for a file that is something else."""
        try:
            with self.path.open("rb") as file:
                begin = file.read(len(MAGIC))
        except FileNotFoundError:
            return False
        except OSError as error:
            raise OutputError(f"{self.path}: cannot be read: {error.strerror}") from error
        if not MAGIC.startswith(begin):
            raise OutputError(f"{self.path}: is in the way: it is no work file of tracer")
        return True

    def start(self, identity: Mapping[str, Any]) -> None:
        """Opens the file for a job with these settings (JSON values by name).

        Raises `UsageError` when the file to be resumed belongs to a job whose settings differ, and when
        another process is working with it.
        """
        mode = "r+b" if self.exists() else "w+b"
        try:
            self._file = self.path.open(mode, buffering=0)
        except OSError as error:
            raise OutputError(f"{self.path}: cannot be written: {error.strerror}") from error
        try:
            self._begin(json.loads(json.dumps(identity)))
        except BaseException:
            self.close()
            raise
        self.started = True

    def _begin(self, identity: Label) -> None:
        assert self._file is not None
        _lock(self._file, self.path)
        self._end = len(MAGIC)
        if self.resume:
            self._scan()
        if self._places:
            _compare(self.path, self._places.pop(0)[0]["label"], identity)
        else:
            self._write(0, [MAGIC])
            self.keep(identity, {})
            self._places.clear()

    def records(self) -> Iterator[tuple[Label, dict[str, np.ndarray]]]:
        """The labels and the arrays of all finished pieces, in the order in which they were kept."""
        for label, place in self._places:
            assert self._file is not None
            self._file.seek(place)
            arrays = {}
            for name, dtype, shape in label["arrays"]:
                arrays[name] = np.empty(shape, dtype)
                _read_into(self._file, arrays[name])
            yield label["label"], arrays

    def keep(self, label: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> None:
        """Appends a finished piece. Raises `OutputError` on a full disk; what was kept before stays."""
        contiguous = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
        kinds = [(name, array.dtype.str, array.shape) for name, array in contiguous.items()]
        text = json.dumps({"label": label, "arrays": kinds}).encode()
        parts: list[Any] = [text, *map(_bytes_of, contiguous.values())]
        size = sum(array.nbytes for array in contiguous.values())
        lengths = _HEAD.pack(len(text), size, 0)
        checksum = zlib.crc32(lengths)
        for part in parts:
            checksum = zlib.crc32(part, checksum)
        self._write(self._end, [_HEAD.pack(len(text), size, checksum), *parts])
        self._places.append((json.loads(text), self._end - size))

    def close(self) -> None:
        """Ends the work with the file, which stays for the next run."""
        if self._file is not None:
            self._sync()
            self._file.close()
            self._file = None

    def remove(self) -> None:
        """The job is done: the file is no longer needed."""
        if self._file is not None:
            self._file.close()
            self._file = None
        with suppress(OSError):
            self.path.unlink()

    def _write(self, place: int, parts: list[Any]) -> None:
        """Writes at a place, which makes the file end there; a failure leaves it as it was."""
        assert self._file is not None
        try:
            self._file.seek(place)
            for part in parts:
                rest = memoryview(part)
                while rest:
                    rest = rest[self._file.write(rest) :]
            self._end = self._file.tell()
            self._file.truncate(self._end)
            if time.monotonic() - self._synced > SYNC_SECONDS:
                self._sync()
        except OSError as error:
            with suppress(OSError):
                self._file.truncate(place)
            raise OutputError(f"{self.path}: cannot be written: {error.strerror}") from error

    def _sync(self) -> None:
        assert self._file is not None
        with suppress(OSError):  # a medium that cannot, a pipe for instance
            os.fsync(self._file.fileno())
        self._synced = time.monotonic()

    def _scan(self) -> None:
        """Finds the whole records; the first one that is not ends the file."""
        assert self._file is not None
        size = os.fstat(self._file.fileno()).st_size
        while (found := _record_at(self._file, self._end, size)) is not None:
            label, place, self._end = found
            self._places.append((label, place))


def _record_at(file: IO[bytes], place: int, size: int) -> tuple[Label, int, int] | None:
    """Label, place of the arrays and end of the record at a place, if it is whole."""
    file.seek(place)
    head = file.read(_HEAD.size)
    if len(head) < _HEAD.size:
        return None
    text_length, array_length, checksum = _HEAD.unpack(head)
    end = place + _HEAD.size + text_length + array_length
    if text_length > _LONGEST_LABEL or end > size:
        return None
    text = file.read(text_length)
    found = zlib.crc32(text, zlib.crc32(_HEAD.pack(text_length, array_length, 0)))
    while array_length > 0 and (chunk := file.read(min(_CHUNK, array_length))):
        found, array_length = zlib.crc32(chunk, found), array_length - len(chunk)
    if found != checksum:
        return None
    return json.loads(text), place + _HEAD.size + text_length, end


def _bytes_of(array: np.ndarray) -> memoryview:
    return array.reshape(-1).view(np.uint8).data


def _read_into(file: IO[bytes], array: np.ndarray) -> None:
    rest = _bytes_of(array)
    while rest:
        rest = rest[file.readinto(rest) :]  # type: ignore[attr-defined]


def _compare(path: Path, before: Label, identity: Label) -> None:
    """Raises `UsageError` that names the first setting that differs."""
    for name in [*identity, *before]:
        if before.get(name) != identity.get(name):
            raise UsageError(
                f"{path}: was begun with another `{name}`: {show(before.get(name))}, now "
                f"{show(identity.get(name))}; without --resume it begins anew"
            )


def _lock(file: IO[bytes], path: Path) -> None:
    """Keeps other processes out until this one ends, in whichever way."""
    try:
        import fcntl
    except ImportError:  # Windows
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise UsageError(f"{path}: another tracer is at work on the same picture") from None
    except OSError:  # a file system without locks
        return
