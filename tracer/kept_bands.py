"""The bands of a picture that are kept in its work file, and taken from it when the picture is resumed."""

from __future__ import annotations

import copy
import hashlib
import json
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tracer.backends import Backend
from tracer.canvas import Canvas
from tracer.film.film import Film
from tracer.film.work_file import WorkFile
from tracer.llvm import ensure_llvm
from tracer.scene import Scene
from tracer.scene.files import file_digests
from tracer.settings import Settings
from tracer.tiles import Band, Rectangle, after
from tracer.version import __version__

PATIENCE = 1.0
"""Seconds for which nothing is written: a picture that takes no longer has nothing to lose."""

_LONG = 200  # characters of a value from which on its digest stands for it


class KeptBands:
    """Keeps what a pass over a rectangle finishes; without a work file it does nothing.

    `seconds`: how long earlier runs traced what `restore` gave back. A band that `finished` has taken is on
    disk, or the picture is younger than `PATIENCE` and its work file not begun.
    """

    def __init__(
        self, work: WorkFile | None, name: list[Any], film: Film, identity: Callable[[], dict[str, Any]]
    ) -> None:
        """`name`: of the pass, JSON."""
        self._work, self._name, self._film, self._identity = work, name, film, identity
        self._started = time.perf_counter()
        self._waiting: list[tuple[Band, dict[str, Any], float]] = []
        self.seconds = 0.0

    def restore(self) -> list[Rectangle]:
        """Takes over what an earlier run finished of this pass; the rectangles that remain."""
        work, film = self._work, self._film
        remaining = [film.rectangle]
        if work is None or not work.resume:
            return remaining
        if not work.started:
            work.start(self._identity())
        for label, arrays in work.records():
            if label["pass"] == self._name:
                band = Band(*label["band"])
                film.take(band, arrays)
                film.counts, self.seconds = label["counts"], label["seconds"]
                remaining = after(film.rectangle, band)
        return remaining

    def finished(self, band: Band) -> None:
        """The film has taken this band. Raises `OutputError` when it cannot be kept."""
        if self._work is None:
            return
        seconds = time.perf_counter() - self._started
        self._waiting.append((band, copy.deepcopy(self._film.counts), self.seconds + seconds))
        if self._work.started or seconds > PATIENCE:
            self.finish()

    def finish(self) -> None:
        """Keeps all that was finished. Raises `OutputError` when it cannot be kept."""
        if self._work is None or not self._waiting:
            return
        if not self._work.started:
            self._work.start(self._identity())
        waiting, self._waiting = self._waiting, []
        for band, counts, seconds in waiting:
            place = {"pass": self._name, "band": (band.x0, band.y0, band.x1, band.y1)}
            self._work.keep(place | {"counts": counts, "seconds": seconds}, self._film.part(band))


def seconds_in(work: WorkFile) -> float:
    """How long earlier runs traced what a work file holds."""
    return sum({str(label["pass"]): label["seconds"] for label in work.labels}.values())


def identity_of(
    scene: Scene,
    settings: Settings,
    canvas: Canvas,
    rectangle: Rectangle,
    backend: Backend,
    layers: Sequence[str],
) -> dict[str, Any]:
    """All that a picture depends on, by name: settings, the keys of the scene, and what its files hold."""
    n = settings.grid(scene)
    named = {
        "tracer version": __version__,
        "backend": str(ensure_llvm()) if backend.name == "llvm" else backend.name,
        "precision": backend.precision,
        "resolution": [canvas.width, canvas.height],
        "scale": canvas.scale,
        "crop": rectangle,
        "supersample": f"adaptive, at most {n}" if settings.adaptive else n,
        "threshold": settings.threshold,
        "aov": layers,
    }
    keys, digests = _flat(scene.to_dict()), file_digests(scene)
    files = {
        f"{key} (what the file holds)": digests[value]
        for key, value in keys.items()
        if key.split(".")[-1] == "file"
    }
    return named | {key: _short(value) for key, value in keys.items()} | files


def _flat(tree: Any, path: str = "") -> dict[str, Any]:
    """The leaves of a tree of tables and lists of tables, by dotted path."""
    if isinstance(tree, Mapping):
        pairs = list(tree.items())
    elif isinstance(tree, (list, tuple)) and any(isinstance(part, Mapping) for part in tree):
        pairs = list(enumerate(tree))
    else:
        return {path: tree}
    leaves: dict[str, Any] = {}
    for name, part in pairs:
        leaves |= _flat(part, f"{path}.{name}" if path else str(name))
    return leaves


def _short(value: Any) -> Any:
    """The value, or a digest that stands for a long one."""
    text = json.dumps(value)
    return value if len(text) <= _LONG else f"sha256 {hashlib.sha256(text.encode()).hexdigest()}"
