"""The renderers that are compared, behind one small interface.

A peer prepares a scene once and then renders frames of it, display-referred float32 (h, w, 3).
`hints` says for each renderer that is not there what installs it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np

import tracer
from reference.bench.povray import PovrayProgram, find_povray
from reference.bench.records import PEERS
from tracer.backends import find_backend
from tracer.cache import forget_everything
from tracer.device_scene import compile_scene
from tracer.errors import MachineError


@dataclass(frozen=True)
class Shot:
    """One frame: the picture, seconds of tracing and of all that a user waits for, the making of the scene
    among it."""

    picture: np.ndarray
    trace: float
    whole: float


class Runner(Protocol):
    """A scene made ready in one renderer."""

    def remake(self) -> None:
        """Makes the scene anew, its files read again; frames from now on count the time of that."""

    def frame(self) -> Shot:
        """Renders it once."""

    def rays(self) -> dict[str, int]:
        """Rays of a frame by kind; called after a frame."""


@dataclass
class TracerRunner:
    """This project's renderer, through its public interface, which keeps what it made of the scene."""

    scene: tracer.Scene
    _made: float = 0.0
    _rays: dict[str, int] = field(default_factory=dict)

    def remake(self) -> None:
        forget_everything()
        started = time.perf_counter()
        compile_scene(self.scene, find_backend("llvm", "single"))
        self._made = time.perf_counter() - started

    def frame(self) -> Shot:
        started = time.perf_counter()
        result = tracer.render(self.scene, backend="llvm")
        whole = time.perf_counter() - started
        self._rays = {kind: int(count) for kind, count in result.stats["rays"].items()}
        return Shot(result.color, result.stats["seconds"]["trace"], self._made + whole)

    def rays(self) -> dict[str, int]:
        return {kind: count for kind, count in self._rays.items() if count}


class MitsubaRunner:
    """The document's formula on Embree's hits, in one Dr.Jit loop (`reference.whitted`)."""

    def __init__(self, scene: tracer.Scene) -> None:
        from reference.mitsuba_variant import mitsuba

        mitsuba()
        from reference.whitted import Whitted

        self._make = partial(Whitted, scene)
        self._whitted, self._made = self._make(), 0.0

    def remake(self) -> None:
        forget_everything()
        started = time.perf_counter()
        self._whitted = self._make()
        self._made = time.perf_counter() - started

    def frame(self) -> Shot:
        started = time.perf_counter()
        picture = self._whitted.color()
        seconds = time.perf_counter() - started
        return Shot(picture, seconds, self._made + seconds)

    def rays(self) -> dict[str, int]:
        kinds = ("primary", "shadow", "reflected", "refracted", "total_reflection")
        counts = self._whitted.render().counts
        return {kind: counts[kind] for kind in kinds if counts.get(kind)}


@dataclass
class PovrayRunner:
    """POV-Ray 3.7 as a process of its own for every frame."""

    program: PovrayProgram

    def remake(self) -> None:
        """Every frame does."""

    def frame(self) -> Shot:
        run = self.program.run()
        return Shot(run.picture, run.trace, run.whole)

    def rays(self) -> dict[str, int]:
        return self.program.last.rays


Maker = Callable[[tracer.Scene, Path, int], Runner]
"""A scene, a folder for files and the number of threads."""


def _tracer(scene: tracer.Scene, folder: Path, threads: int) -> Runner:
    return TracerRunner(scene)


def _mitsuba(scene: tracer.Scene, folder: Path, threads: int) -> Runner:
    return MitsubaRunner(scene)


def _povray(scene: tracer.Scene, folder: Path, threads: int) -> Runner:
    return PovrayRunner(PovrayProgram(scene, folder, threads))


MAKERS: dict[str, Maker] = {"tracer": _tracer, "mitsuba": _mitsuba, "povray": _povray}


def hints() -> dict[str, str]:
    """For every peer that is not installed, the sentence that says what helps."""
    found = {}
    try:
        from reference.mitsuba_variant import mitsuba

        mitsuba()
    except MachineError as error:
        found["mitsuba"] = str(error)
    if find_povray() is None:
        found["povray"] = "POV-Ray is not installed; `apt install povray` (or your system's way) installs it"
    return {peer: hint for peer, hint in found.items() if peer in PEERS}
