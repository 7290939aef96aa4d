"""How fast an animation was, and `--stats` of it: where the time went, rays by kind, kernels, memory."""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import contextmanager

from tracer.cli.statistics import KernelRecord, peak_memory
from tracer.film.result import Result

_PHASES = {"tables": "compile", "trace": "trace", "filter": "filter"}
"""The phases of `tracer.render` under the names of the report."""


class AnimationStatistics:
    """Sums over all frames; of single frames nothing is kept."""

    def __init__(self, wanted: bool) -> None:
        self._wanted = wanted
        self._started = time.perf_counter()
        self._seconds: defaultdict[str, float] = defaultdict(float)
        self._rays: Counter[str] = Counter()
        self._frames = self._compiled_first = self._compiled_later = 0

    @contextmanager
    def frame(self) -> Iterator[None]:
        """Around the rendering of a frame: the kernels that it compiles are counted, if that is wanted."""
        kernels = KernelRecord(self._wanted)
        with kernels:
            yield
        compiled = sum(not kernel["cache_hit"] for kernel in kernels.kernels)
        if self._frames:
            self._compiled_later += compiled
        else:
            self._compiled_first += compiled

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Around a part of the work that nothing else runs beside."""
        started = time.perf_counter()
        yield
        self._seconds[name] += time.perf_counter() - started

    def take(self, result: Result) -> None:
        """Adds a frame."""
        self._frames += 1
        self._rays.update(result.stats["rays"])
        for phase, name in _PHASES.items():
            self._seconds[phase] += result.stats["seconds"][name]

    def written(self, seconds: float) -> None:
        """Adds the time that the writer took, beside the tracing."""
        self._seconds["written beside it"] += seconds

    def speed(self) -> str:
        """`140.21 s  0.86 frames/s`."""
        seconds = time.perf_counter() - self._started
        return f"{seconds:.2f} s  {self._frames / max(seconds, 1e-9):.2f} frames/s"

    def text(self) -> str:
        """The report."""
        seconds = max(time.perf_counter() - self._started, 1e-9)
        phases = ", ".join(f"{phase} {value:.2f}" for phase, value in self._seconds.items())
        kinds = ", ".join(f"{kind.replace('_', ' ')} {count}" for kind, count in self._rays.items())
        peak = peak_memory()
        rows = [
            ("seconds", f"{seconds:.2f} in all: {phases}"),
            ("not tracing", f"{100 * (1 - self._seconds['trace'] / seconds):.1f} % of the time"),
            ("rays", f"{self._rays.total()}: {kinds}"),
            (
                "kernels",
                f"{self._compiled_first} compiled for the first frame, {self._compiled_later} after it",
            ),
            ("peak memory", "unknown" if peak is None else f"{peak / 2**20:.0f} MiB"),
        ]
        return "\n".join(f"{name:<14}{value}" for name, value in rows)
