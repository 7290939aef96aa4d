"""What takes long to make is kept, and found again by what it was made of.

A cache holds few entries and a limited number of bytes; the newest entry stays whatever its size, since it is
what is being worked on. All caches together hold at most 1.25 GiB beside that. What is in a cache is shared,
so nobody changes it.
"""

from __future__ import annotations

import os
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import drjit as dr
import numpy as np

Value = TypeVar("Value")


class Cache(Generic[Value]):
    """Values by key: at most so many `entries`, and `megabytes` unless one alone is larger. A key keeps what
    it is made of alive, so objects may stand in it for what they hold."""

    def __init__(self, entries: int, megabytes: int) -> None:
        self._entries, self._bytes = entries, megabytes << 20
        self._kept: OrderedDict[Hashable, Value] = OrderedDict()
        self._sizes: dict[Hashable, int] = {}  # of those that were ever weighed against others
        self._lock = threading.Lock()
        _CACHES.append(self)

    def get(self, key: Hashable, make: Callable[[], Value]) -> Value:
        """The value of a key, made where there is none."""
        found = self.find(key)
        if found is None:
            found = make()
            self.keep(key, found)
        return found

    def find(self, key: Hashable) -> Value | None:
        """The value of a key; None where there is none."""
        with self._lock:
            if key not in self._kept:
                return None
            self._kept.move_to_end(key)
            return self._kept[key]

    def keep(self, key: Hashable, value: Value) -> None:
        """Sets the value of a key, and drops what was not asked for the longest time."""
        with self._lock:
            self._kept[key] = value
            self._kept.move_to_end(key)
            self._sizes.pop(key, None)
            while len(self._kept) > 1 and (len(self._kept) > self._entries or self._weight() > self._bytes):
                self._sizes.pop(self._kept.popitem(last=False)[0], None)

    def forget(self) -> None:
        """Drops everything."""
        with self._lock:
            self._kept.clear()
            self._sizes.clear()

    def _weight(self) -> int:
        for key, value in self._kept.items():
            if key not in self._sizes:
                self._sizes[key] = bytes_of(value)
        return sum(self._sizes.values())


class Identity:
    """Stands in a key for an object that cannot change, and that takes long to compare."""

    def __init__(self, value: object) -> None:
        self._value = value

    def __hash__(self) -> int:
        return id(self._value)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Identity) and self._value is other._value


_CACHES: list[Cache[Any]] = []


def forget_everything() -> None:
    """Empties all caches: to measure without them, or where code was changed while it runs."""
    for cache in _CACHES:
        cache.forget()


def bytes_of(record: Any) -> int:
    """The bytes of all arrays below a record, NumPy's and Dr.Jit's."""
    if isinstance(record, np.ndarray):
        return record.nbytes
    if is_dataclass(record) and not isinstance(record, type):
        return sum(bytes_of(getattr(record, field.name)) for field in fields(record))
    if isinstance(record, dict):
        return sum(map(bytes_of, record.values()))
    if isinstance(record, (list, tuple)):
        return sum(map(bytes_of, record))
    if isinstance(record, type) or not dr.is_array_v(record):
        return 0
    if dr.depth_v(record) > 1:
        return sum(map(bytes_of, record))
    return int(dr.width(record)) * int(dr.itemsize_v(record))


# ---- Files -------------------------------------------------------------------------------------------------

Stamp = tuple[int, ...]
"""What changes with the content of a file: where it is, its size, when it was written and changed."""

TICK = 50_000_000
"""Nanoseconds within which a file system may give two changes of a file the same time."""

COARSE_TICK = 2_000_000_000
"""The same where times have whole seconds."""


def stamp_of(path: Path) -> Stamp | None:
    """The stamp of a file; None where none can be had."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return None
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns


@dataclass(frozen=True)
class Stamps:
    """How files were when something was made of them; `settled`: whether a later change shows."""

    stamps: dict[Path, Stamp | None]
    settled: bool

    @staticmethod
    def of(paths: Iterable[Path], since: int) -> Stamps:
        """The stamps of files that were read since that time (`time.time_ns`)."""
        stamps = {path: stamp_of(path) for path in paths}
        return Stamps(stamps, all(stamp is None or _is_older(stamp, since) for stamp in stamps.values()))

    @property
    def still_true(self) -> bool:
        """Whether all files are as they were."""
        return self.settled and all(stamp_of(path) == stamp for path, stamp in self.stamps.items())


def _is_older(stamp: Stamp, time_ns: int) -> bool:
    """Whether the file was last changed so long before that a change since then has another time."""
    written, changed = stamp[3:5]
    coarse = written % 1_000_000_000 == 0
    return max(written, changed) + (COARSE_TICK if coarse else TICK) < time_ns


class FileCache(Generic[Value]):
    """What was read from files, as long as these stay as they were."""

    def __init__(self, entries: int, megabytes: int) -> None:
        self._cache: Cache[tuple[Stamps, Value]] = Cache(entries, megabytes)

    def get(self, path: Path, read: Callable[[Path], tuple[Value, Iterable[Path]]]) -> Value:
        """What `read` gives for a file; it also says which further files it read."""
        found = self._cache.find(path)
        if found is not None and found[0].still_true:
            return found[1]
        since = time.time_ns()
        value, others = read(path)
        self._cache.keep(path, (Stamps.of([path, *others], since), value))
        return value
