"""A work file keeps what a long job has finished, so that nothing is lost when the job is stopped.

It stands beside the output while the job is under way. Finished pieces are appended to it, each a label (any
JSON) and arrays by name; after Ctrl-C, `kill -9` or a full disk the next run finds them again:

    work = WorkFile("out/a.work", resume=True)
    work.start({"frames": "0:120", "camera.fov": 40})   # what must be the same, else UsageError names it
    done = {label["frame"]: arrays["color"] for label, arrays in work.records()}
    work.keep({"frame": 12}, {"color": color})
    work.remove()                                       # when the output is written

A record that was cut short by a crash is recognized (`tracer.film.work_record`); it is dropped, and the file
goes on after the last whole one. All that `keep` has written survives the process; what a power failure
leaves is about `SYNC_SECONDS` old at most.
"""

from __future__ import annotations

import json
import os
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

import numpy as np

from tracer.errors import OutputError, UsageError
from tracer.film.work_record import Label, Record, record_after, write_record
from tracer.messages import show

MAGIC = b"tracer work file 2\n"
SYNC_SECONDS = 10.0


class WorkFile:
    """See the module. `resume`: go on with what the file holds; otherwise it is begun anew."""

    def __init__(self, path: str | os.PathLike[str], resume: bool = False) -> None:
        self.path, self.resume = Path(path), resume
        self.started = False
        self._file: IO[bytes] | None = None
        self._records: list[Record] = []  # the first one says which job it is
        self._synced = time.monotonic()
        self._syncing: threading.Thread | None = None

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

    def identity(self) -> Label | None:
        """Of which job the file is; None where there is none, or where its beginning is damaged."""
        if not self.exists():
            return None
        with self.path.open("rb") as file:
            first = record_after(file, len(MAGIC), os.fstat(file.fileno()).st_size)
        return None if first is None else first.label

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

    def restart(self, identity: Mapping[str, Any]) -> None:
        """Goes over to another job in the same file, whose memory is used again: that takes a third of the
        time of new memory. What the file held is gone. Raises `OutputError`."""
        self.resume = False
        self._synced = time.monotonic()  # what is gone need not reach the medium
        self._records.clear()
        self.keep(identity, {})

    def _begin(self, identity: Label) -> None:
        assert self._file is not None
        _lock(self._file, self.path)
        if self.resume:
            self._scan()
        if self._records:
            _compare(self.path, self._records[0].label, identity)
        else:
            self._write_magic()
            self.keep(identity, {})

    @property
    def labels(self) -> list[Label]:
        """The labels of all finished pieces, in the order in which they were kept."""
        return [record.label for record in self._records[1:]]

    def records(self) -> Iterator[tuple[Label, dict[str, np.ndarray]]]:
        """The labels and the arrays of all finished pieces, in the order in which they were kept."""
        for record in self._records[1:]:
            assert self._file is not None
            yield record.label, record.arrays(self._file)

    def keep(self, label: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> None:
        """Appends a finished piece. Raises `OutputError` on a full disk; what was kept before stays."""
        assert self._file is not None
        before = self._records[-1] if self._records else len(MAGIC)
        try:
            self._records.append(write_record(self._file, before, label, arrays))
        except OSError as error:
            with suppress(OSError):
                self._file.truncate(before if isinstance(before, int) else before.end)
            raise OutputError(f"{self.path}: cannot be written: {error.strerror}") from error
        self._sync_now_and_then()

    def close(self) -> None:
        """Ends the work with the file, which stays for the next run."""
        if self._file is not None:
            self._end_sync()
            _sync(self._file.fileno())
            self._file.close()
            self._file = None

    def remove(self) -> None:
        """The job is done: the file is no longer needed."""
        if self._file is not None:
            self._end_sync()
            self._file.close()
            self._file = None
        with suppress(OSError):
            self.path.unlink()

    def _write_magic(self) -> None:
        assert self._file is not None
        try:
            self._file.truncate(0)
            self._file.seek(0)
            self._file.write(MAGIC)
        except OSError as error:
            raise OutputError(f"{self.path}: cannot be written: {error.strerror}") from error

    def _scan(self) -> None:
        """Finds the whole records; the first one that is not ends the file."""
        assert self._file is not None
        size = os.fstat(self._file.fileno()).st_size
        before: Record | int = len(MAGIC)
        while (record := record_after(self._file, before, size)) is not None:
            self._records.append(record)
            before = record

    def _sync_now_and_then(self) -> None:
        """Beside the work, since a slow medium takes seconds for it."""
        assert self._file is not None
        if time.monotonic() - self._synced > SYNC_SECONDS:
            self._end_sync()
            self._syncing = threading.Thread(target=_sync, args=(self._file.fileno(),))
            self._syncing.start()
            self._synced = time.monotonic()

    def _end_sync(self) -> None:
        if self._syncing is not None:
            self._syncing.join()


def _sync(file: int) -> None:
    with suppress(OSError):  # a medium that cannot, a pipe for instance
        os.fsync(file)


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
