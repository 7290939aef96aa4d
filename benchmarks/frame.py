"""How long one frame of the benchmark room takes, here and in other renderers: one process, interleaved runs.

    python benchmarks/frame.py [--size 1024] [--runs 9] [--json FILE] [--only NAME ...]

Prints milliseconds a frame (the whole call, from the scene in memory to colors in NumPy; for POV-Ray the
whole process), rays by kind, size and compile time of the Dr.Jit kernels, and how far the pictures differ.
"cold" is the first frame, with an empty kernel cache; "warm" are all later ones. Renderers that are not
installed are left out with a hint.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import platform
import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from peers import TILE, Mitsuba, Povray, Renderer, Tracer, Unavailable


@dataclass
class Report:
    """What was measured of one renderer; times in ms."""

    name: str
    setup: float
    cold: float
    kernels: dict[str, float]  # of the cold frame: kernels, operations, codegen, compile
    warm: list[float] = field(default_factory=list)
    rays: dict[str, int] = field(default_factory=dict)
    details: dict[str, Any] = field(default_factory=dict)

    @property
    def median(self) -> float:
        return statistics.median(self.warm)


def timed(function: Callable[[], Any]) -> tuple[Any, float]:
    """The function's value and how many milliseconds it took, pending kernels included."""
    import drjit as dr

    dr.sync_thread()
    start = time.perf_counter()
    value = function()
    dr.sync_thread()
    return value, 1e3 * (time.perf_counter() - start)


def cold_frame(renderer: Renderer) -> tuple[np.ndarray, float, dict[str, float]]:
    """The first picture, its time, and what was compiled for it."""
    import drjit as dr

    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        picture, elapsed = timed(renderer.frame)
        history = [entry for entry in dr.kernel_history() if "operation_count" in entry]
    if not renderer.uses_drjit:
        return picture, elapsed, {}
    return picture, elapsed, {
        "kernels": len(history),
        "operations": sum(entry["operation_count"] for entry in history),
        "codegen": sum(entry["codegen_time"] for entry in history),
        "compile": sum(entry["backend_time"] for entry in history),
    }  # fmt: skip


def available(size: int, only: list[str]) -> list[tuple[Renderer, float]]:
    """The renderers that are installed (and asked for), with the time their set-up took."""
    import drjit as dr

    orders = ["scan"] if size % TILE else ["morton", "scan"]
    makers: list[tuple[str, Callable[[], Renderer]]] = [
        ("tracer", lambda: Tracer(size)),
        *(("mitsuba", partial(Mitsuba, size, order)) for order in orders),
        ("mitsuba", lambda: Mitsuba(size, orders[0], occlusion="test")),
        ("povray", lambda: Povray(size, threads=dr.thread_count())),
    ]
    found = []
    for name, make in makers:
        if only and name not in only:
            continue
        try:
            found.append(timed(make))
        except Unavailable as hint:
            print(f"left out: {hint}")
    return found


def measure(size: int, runs: int, only: list[str]) -> tuple[list[Report], dict[str, np.ndarray]]:
    """Cold frames one renderer after the other, then `runs` rounds of one warm frame each."""
    renderers, reports, pictures = [], [], {}
    for renderer, setup in available(size, only):
        picture, cold, kernels = cold_frame(renderer)
        renderers.append(renderer)
        reports.append(Report(renderer.name, setup, cold, kernels))
        pictures[renderer.name] = picture
    for _ in range(runs):
        for renderer, report in zip(renderers, reports, strict=True):
            report.warm.append(timed(renderer.frame)[1])
    for renderer, report in zip(renderers, reports, strict=True):
        report.rays, report.details = renderer.rays(), renderer.details()
    return reports, pictures


def differences(pictures: dict[str, np.ndarray]) -> dict[str, dict[str, float]]:
    """Each picture against the first: share of pixels off by more than 2/255 and 8/255, and the largest."""
    first = next(iter(pictures.values()))
    table = {}
    for name, picture in list(pictures.items())[1:]:
        error = np.abs(np.clip(picture, 0, 1) - np.clip(first, 0, 1)).max(axis=-1)
        shares = {f"> {bound}/255": float(np.mean(error > bound / 255)) for bound in (2, 8)}
        table[name] = shares | {"largest": float(error.max())}
    return table


def machine() -> dict[str, Any]:
    """Where and with what the numbers were taken."""
    import drjit as dr

    facts = {"system": platform.platform(), "python": platform.python_version(), "drjit": dr.__version__}
    return facts | {"llvm": ".".join(map(str, dr.detail.llvm_version())), "threads": dr.thread_count()}


def print_table(reports: list[Report], deviations: dict[str, dict[str, float]]) -> None:
    """The measurements as text."""
    print(f"\n{'ms a frame':24}{'warm median':>12}{'warm min':>10}{'cold':>9}{'set-up':>9}{'x median':>10}")
    base = reports[0].median
    for r in reports:
        ratio = r.median / base
        print(f"{r.name:24}{r.median:12.1f}{min(r.warm):10.1f}{r.cold:9.1f}{r.setup:9.1f}{ratio:10.2f}")
    print(f"\nx median: median over the median of {reports[0].name}\n")
    for r in reports:
        if r.kernels:
            print(
                f"{r.name}: {r.kernels['kernels']:.0f} kernels, {r.kernels['operations']:.0f} operations, "
                f"compiled in {r.kernels['compile']:.0f} ms"
            )
        print(f"{r.name}: rays " + ", ".join(f"{kind} {count:,}" for kind, count in r.rays.items()))
        if r.details:
            print(f"{r.name}: last frame " + ", ".join(f"{key} {value}" for key, value in r.details.items()))
    for name, row in deviations.items():
        text = ", ".join(f"{key} {value:.4%}" for key, value in row.items() if key != "largest")
        print(f"{name} against {reports[0].name}: pixels off by {text}; largest {row['largest']:.3f}")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--size", type=int, default=1024, help="pixels across (default 1024)")
    parser.add_argument("--runs", type=int, default=9, help="warm frames of each renderer (default 9)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers there")
    parser.add_argument("--only", nargs="+", default=[], choices=["tracer", "mitsuba", "povray"])
    options = parser.parse_args()
    if options.size < 1 or options.runs < 1:
        parser.error("--size and --runs must be at least 1")
    with tempfile.TemporaryDirectory() as cache:
        os.environ["DRJIT_CACHE_DIR"] = cache  # read when Dr.Jit starts: an empty cache, so that cold is cold
        with contextlib.suppress(ImportError):
            import tracer  # noqa: F401  (chooses the LLVM library, which must happen before Dr.Jit is imported)
        reports, pictures = measure(options.size, options.runs, options.only)
        if not reports:
            parser.error("none of the renderers is installed")
        deviations = differences(pictures)
        facts = machine()
    print_table(reports, deviations)
    if options.json:
        rows = [asdict(report) | {"median": report.median, "min": min(report.warm)} for report in reports]
        text = {"machine": facts, "size": options.size, "renderers": rows, "differences": deviations}
        options.json.write_text(json.dumps(text, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
