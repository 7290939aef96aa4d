"""How fast an animation was, and `--stats` of it: where the time went, what all frames took together."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from tracer.cli.statistics import as_table, count_rows, counts_with_names, in_mebibytes, peak_memory
from tracer.film.counts import counts_in, together
from tracer.film.result import Result
from tracer.scene import Scene


class AnimationStatistics:
    """Sums over all frames; of single frames nothing is kept. Times and kernels are those of this run, counts
    those of earlier runs as well."""

    def __init__(self) -> None:
        self._started = time.perf_counter()
        self._seconds: defaultdict[str, float] = defaultdict(float)
        self._counts: dict[str, Any] | None = None
        self._frames = self._compiled_first = self._compiled_later = 0

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Around a part of the work that nothing else runs beside."""
        started = time.perf_counter()
        yield
        self._seconds[name] += time.perf_counter() - started

    def take(self, result: Result, earlier: float) -> None:
        """Adds a frame that was rendered; `earlier`: the seconds of it that earlier runs have traced."""
        if self._frames:
            self._compiled_later += result.kernels["compiled"]
        else:
            self._compiled_first += result.kernels["compiled"]
        self._frames += 1
        self.add_counts(counts_in(result.stats))
        for phase, seconds in result.stats["seconds"].items():
            self._seconds[phase] += seconds - (earlier if phase == "trace" else 0)

    def add_counts(self, counts: Mapping[str, Any]) -> None:
        """Adds what a frame took."""
        self._counts = dict(counts) if self._counts is None else together(self._counts, counts)

    def written(self, seconds: float) -> None:
        """Adds the time that the writer took, beside the tracing."""
        self._seconds["write"] += seconds

    def speed(self) -> str:
        """`140.21 s  0.86 frames/s`."""
        seconds = time.perf_counter() - self._started
        return f"{seconds:.2f} s  {self._frames / max(seconds, 1e-9):.2f} frames/s"

    def summary(self, scene: Scene) -> dict[str, Any]:
        """All that is told, ready for JSON."""
        return {
            **counts_with_names(self._counts or {}, scene),
            "rendered": self._frames,
            "seconds": {"whole": time.perf_counter() - self._started, **self._seconds},
            "kernels": {"compiled": self._compiled_first, "compiled_later": self._compiled_later},
            "peak_memory": peak_memory(),
        }


def format_animation(statistics: Mapping[str, Any]) -> str:
    """The report, from a summary."""
    seconds, kernels = dict(statistics["seconds"]), statistics["kernels"]
    whole, beside = max(seconds.pop("whole"), 1e-9), seconds.pop("write", 0.0)
    phases = ", ".join(f"{phase} {value:.2f}" for phase, value in seconds.items())
    not_tracing = 100 * (1 - seconds.get("trace", 0.0) / whole)
    rows = [
        ("seconds", f"{whole:.2f} in all: {phases}; beside it, write {beside:.2f}"),
        ("not tracing", f"{not_tracing:.1f} % of the time"),
        *count_rows(statistics),
        (
            "kernels",
            f"{kernels['compiled']} compiled for the first frame, {kernels['compiled_later']} after it",
        ),
        ("peak memory", in_mebibytes(statistics["peak_memory"])),
    ]
    return as_table(rows)
