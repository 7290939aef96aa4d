"""How far a render is: a bar, JSON lines or nothing, on stderr."""

from __future__ import annotations

import json
import os
import sys
import time
from typing import Any, Protocol

import click

KINDS = ("auto", "bar", "json", "none")


class Reporter(Protocol):
    """Takes news of one picture."""

    def update(self, done: int, total: int, rays: int) -> None:
        """So many pixels of all are finished, with so many rays so far."""

    def close(self) -> None:
        """The picture is over, finished or not."""


def make_reporter(kind: str, name: str) -> Reporter:
    """The reporter for `--progress`; `auto` is a bar on a terminal and nothing elsewhere."""
    if kind == "auto":
        kind = "bar" if sys.stderr is not None and sys.stderr.isatty() else "none"
    return _Bar(name) if kind == "bar" else _JsonLines(name) if kind == "json" else _Silence()


class FramesProgress:
    """Of an animation of so many frames, as one long picture; `finished`: how many of them are traced."""

    def __init__(self, reporter: Reporter, frames: int) -> None:
        self._reporter, self._frames = reporter, frames
        self._rays = self._rays_of_frame = 0
        self.finished = 0

    def update(self, done: int, total: int, rays: int) -> None:
        """So many pixels of this frame are finished, with so many rays of this run."""
        self._rays_of_frame = rays
        self._reporter.update(self.finished * total + done, self._frames * total, self._rays + rays)

    def next_frame(self) -> None:
        """The frame is traced."""
        self._rays += self._rays_of_frame
        self.finished += 1


class _Silence:
    def update(self, done: int, total: int, rays: int) -> None:
        pass

    def close(self) -> None:
        pass


class _JsonLines:
    """One object a line: pixels done and in all, rays and seconds so far, seconds that remain at this rate
    (null at first), the scene. What an earlier run has done counts as done, and not for the rate."""

    def __init__(self, name: str) -> None:
        self._name, self._started = name, time.perf_counter()
        self._first: int | None = None

    def update(self, done: int, total: int, rays: int) -> None:
        if self._first is None or done < self._first:
            self._first = done
        seconds = time.perf_counter() - self._started
        new = done - self._first
        line = {
            "done": done,
            "total": total,
            "rays": rays,
            "seconds": round(seconds, 3),
            "remaining": round(seconds * (total - done) / new, 3) if new else None,
        }
        click.echo(json.dumps(line | ({"scene": self._name} if self._name else {})), err=True)

    def close(self) -> None:
        pass


class _Bar:
    """A bar with elapsed and remaining time and rays a second; a second pass starts a new one."""

    FORMAT = "{desc} {percentage:3.0f} % |{bar}| {elapsed} elapsed, {remaining} remaining{postfix}"

    def __init__(self, name: str) -> None:
        self._name, self._started = name, time.perf_counter()
        self._bar: Any = self._new_bar(None)

    def update(self, done: int, total: int, rays: int) -> None:
        resumed = self._bar.total is None and rays == 0  # what an earlier run has done makes no rate
        if done < self._bar.n or resumed:
            self._bar.close()
            self._bar = self._new_bar(total, done)
        self._bar.total = total
        speed = rays / (time.perf_counter() - self._started) / 1e6
        self._bar.set_postfix_str(f"{speed:.1f} Mrays/s", refresh=False)
        self._bar.update(done - self._bar.n)
        if done == total:
            self._bar.refresh()  # tqdm draws ten times a second at most

    def close(self) -> None:
        self._bar.close()

    def _new_bar(self, total: int | None, done: int = 0) -> Any:
        from tqdm import tqdm

        tqdm.monitor_interval = 0  # no thread of its own
        options = {"desc": self._name, "file": sys.stderr, "leave": False, "bar_format": self.FORMAT}
        return tqdm(total=total, initial=done, **options, **_size())


def _size() -> dict[str, int]:
    """That of a terminal which does not know its own, as under `script`: tqdm would draw nothing."""
    try:
        columns, lines = os.get_terminal_size(sys.stderr.fileno())
    except (OSError, ValueError):  # no terminal
        return {}
    return {} if columns and lines else {"ncols": columns or 80, "nrows": lines or 24}
