"""Where the time of a render goes, and the kernels that it needed."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import drjit as dr


class Phases:
    """`seconds` by phase, compilation of kernels apart; `kernels`: how many were compiled, how many came from
    the disk cache, how many launches reused one.

    Dr.Jit's record of kernels is kept only while nobody else keeps it; otherwise kernels are not counted, and
    compiling them belongs to the phase that needed them.
    """

    def __init__(self) -> None:
        self.seconds = dict.fromkeys(("build", "compile", "trace", "filter"), 0.0)
        self.kernels = dict.fromkeys(("compiled", "from_disk", "reused"), 0)
        self._ours = False

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Around the work of a phase, which may come more than once."""
        self._ours = not dr.flag(dr.JitFlag.KernelHistory)
        before, started = self.seconds["compile"], time.perf_counter()
        if self._ours:
            dr.kernel_history_clear()
            dr.set_flag(dr.JitFlag.KernelHistory, True)
        try:
            yield
        finally:
            self.count_kernels()
            if self._ours:
                dr.set_flag(dr.JitFlag.KernelHistory, False)
            compiled = self.seconds["compile"] - before
            self.seconds[name] += max(0.0, time.perf_counter() - started - compiled)

    def count_kernels(self) -> None:
        """Counts the kernels since the last call. To be called now and then: the record holds their code."""
        for kernel in dr.kernel_history([dr.KernelType.JIT]) if self._ours else ():
            kind = "reused"
            if not kernel["cache_hit"]:
                kind = "compiled"
            elif kernel["cache_disk"]:
                kind = "from_disk"
            self.kernels[kind] += 1
            self.seconds["compile"] += (kernel["codegen_time"] + kernel["backend_time"]) / 1000
