"""What stays in memory: each structure of a scene brings kernels of its own, and Dr.Jit keeps them all, as it
keeps the memory of arrays that are gone."""

from __future__ import annotations

import ctypes
import sys

import drjit as dr

from tracer.replay import forget_recordings

MOST_KERNELS = 64
"""Loaded kernels, each with about 0.5 MiB, above which all are dropped. Those that are needed come back from
Dr.Jit's folder."""


class KernelBound:
    """Drops the kernels of this process whenever more than `most` were loaded since the last time."""

    def __init__(self, most: int = MOST_KERNELS) -> None:
        self._most = most
        self._dropped = 0  # of all that were ever loaded

    def keep(self) -> None:
        """Keeps the bound; for the thread that renders, between two pictures."""
        if loaded_kernels() - self._dropped > self._most:
            forget_recordings()  # they would record themselves again, one by one
            dr.flush_kernel_cache()
            self._dropped = loaded_kernels()


def loaded_kernels() -> int:
    """Kernels that this process has loaded or compiled so far, those among them that were dropped."""
    _, loaded, compiled = dr.detail.launch_stats()
    return int(loaded + compiled)


def give_back() -> None:
    """Returns free memory to the system: that of arrays, of all sizes there were, and what the C library of
    Linux keeps. Takes about a millisecond."""
    dr.flush_malloc_cache()
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)
