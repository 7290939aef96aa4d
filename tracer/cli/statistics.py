"""`--stats`: where the time went, rays by kind, how paths ended, kernels and memory."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Sequence
from typing import Any

from tracer.cli import STARTED


def seconds_since_start() -> float:
    """Seconds since this process started (Linux), elsewhere since the package `tracer.cli` was imported."""
    try:
        with open("/proc/self/stat", encoding="ascii", errors="replace") as file:
            ticks = int(file.read().rpartition(")")[2].split()[19])  # field 22 of proc(5): starttime
        return time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, AttributeError):
        return time.perf_counter() - STARTED


def peak_memory() -> int | None:
    """The most memory this process held so far, in bytes; None where the system does not say (Windows)."""
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


class KernelRecord:
    """Dr.Jit's record of the kernels that ran inside the block; recording costs nothing measurable."""

    def __init__(self, wanted: bool) -> None:
        self._wanted = wanted
        self.kernels: list[dict[str, Any]] = []

    def __enter__(self) -> KernelRecord:
        if self._wanted:
            import drjit as dr

            dr.kernel_history_clear()
            dr.set_flag(dr.JitFlag.KernelHistory, True)
        return self

    def __exit__(self, *_: object) -> None:
        if self._wanted:
            import drjit as dr

            dr.set_flag(dr.JitFlag.KernelHistory, False)
            self.kernels = dr.kernel_history([dr.KernelType.JIT])

    def text(self) -> str:
        """How many were compiled, in which time, and how many were there already."""
        compiled = [kernel for kernel in self.kernels if not kernel["cache_hit"]]
        seconds = sum(kernel["codegen_time"] + kernel["backend_time"] for kernel in self.kernels) / 1000
        disk = sum(bool(kernel["cache_hit"] and kernel["cache_disk"]) for kernel in self.kernels)
        reused = len(self.kernels) - len(compiled) - disk
        return (
            f"{len(compiled)} compiled, {disk} read from the disk cache, {reused} reused; "
            f"{seconds:.2f} s of the time above"
        )


def format_statistics(stats: dict[str, Any], seconds: dict[str, float], kernels: KernelRecord) -> str:
    """The report on one picture; `seconds` by phase, in the order in which they passed."""
    kinds = {kind.replace("_", " "): count for kind, count in stats["rays"].items()}
    peak = peak_memory()
    rows = [
        ("seconds", _listed([f"{phase} {value:.2f}" for phase, value in seconds.items()])),
        ("rays", f"{sum(kinds.values())}: {_listed([f'{kind} {count}' for kind, count in kinds.items()])}"),
        ("deepest level", str(stats["deepest_level"])),
        ("paths ended", f"by weight {stats['ended_by_cutoff']}, by depth {stats['ended_by_depth']}"),
        ("kernels", kernels.text()),
        ("peak memory", "unknown" if peak is None else f"{peak / 2**20:.0f} MiB"),
    ]
    return "\n".join(f"{name:<14}{value}" for name, value in rows)


def _listed(parts: Sequence[str]) -> str:
    return ", ".join(parts)
