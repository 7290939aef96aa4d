"""One picture by all peers, interleaved: a round has one frame of each, and every round another one first."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import tracer
from reference.bench.peers import MAKERS, Runner, Shot
from reference.bench.processes import process_of
from reference.bench.records import Frame, Point, Process, Series
from tracer.backends import thread_count

LEVEL = 2.5 / 255
"""Pixels that differ by more are counted."""

Check = Callable[[], None]
"""Called between frames; raises to stop."""


@dataclass(frozen=True)
class Terms:
    """How frames are measured: by which `peers`, on how many `threads`, `repeat` rounds at most, and for each
    peer until `budget` seconds are spent; `check` is called between frames."""

    peers: Sequence[str]
    threads: int
    repeat: int
    budget: float
    check: Check


@dataclass
class _Runs:
    """One peer's frames so far."""

    peer: str
    runner: Runner
    trace: list[float] = field(default_factory=list)
    whole: list[float] = field(default_factory=list)
    picture: np.ndarray | None = None
    spent: float = 0.0

    def take(self) -> Shot:
        """Renders a frame that counts."""
        started = time.perf_counter()
        shot = self.runner.frame()
        self.spent += time.perf_counter() - started
        self.trace.append(shot.trace)
        self.whole.append(shot.whole)
        self.picture = shot.picture
        return shot

    def wants(self, terms: Terms) -> bool:
        """Whether there is time for another one."""
        return len(self.trace) < terms.repeat and (self.spent < terms.budget or not self.trace)


def measure(name: str, x: float, scene: tracer.Scene, terms: Terms, in_full: bool = False) -> Point:
    """The frames of one scene; `in_full`: with rays by kind, and each peer in a process of its own."""
    with tempfile.TemporaryDirectory() as folder, thread_count(terms.threads):
        processes = tuple(_processes(scene, Path(folder), terms)) if in_full else ()
        runs = [_Runs(peer, MAKERS[peer](scene, _place(folder, peer), terms.threads)) for peer in terms.peers]
        for run in runs:
            if run.peer != "povray":  # a new process each time, which nothing makes warm
                run.runner.frame()
                run.runner.remake()
                run.runner.frame()
            terms.check()
        for round_ in range(terms.repeat):
            turn = round_ % len(runs)
            for run in runs[turn:] + runs[:turn]:
                if run.wants(terms):
                    run.take()
                terms.check()
        frames = tuple(_frame(run, runs[0], in_full) for run in runs)
    width, height = scene.camera.resolution
    return Point(name, x, width * height, frames, processes)


def _place(folder: str, peer: str) -> Path:
    place = Path(folder) / peer
    place.mkdir(exist_ok=True)
    return place


def _processes(scene: tracer.Scene, folder: Path, terms: Terms) -> list[Process]:
    found = []
    for peer in terms.peers:
        found.append(process_of(peer, scene, _place(str(folder), f"{peer}-alone"), terms.threads))
        terms.check()
    return found


def _frame(run: _Runs, first: _Runs, in_full: bool) -> Frame:
    differing = float("nan")
    if run is not first and first.peer == "tracer" and run.picture is not None and first.picture is not None:
        error = np.abs(np.clip(run.picture, 0, 1) - np.clip(first.picture, 0, 1)).max(axis=-1)
        differing = float(np.mean(error > LEVEL))
    rays = run.runner.rays() if in_full else {}
    return Frame(run.peer, Series(tuple(run.trace)), Series(tuple(run.whole)), rays, differing)
