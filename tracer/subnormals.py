"""Subnormal numbers are zero, whichever thread computes.

Dr.Jit's own threads flush them to zero on x86 processors, also while the calling thread helps them; a kernel
that is too small to be shared, or that has one thread for itself, would keep them.
"""

from __future__ import annotations

import ctypes
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

if sys.platform == "win32":
    _FLUSH, _MASK = 0x01000000, 0x03000000  # _DN_FLUSH, _MCW_DN of float.h
else:
    # Bits 15 (results) and 6 (operands) of MXCSR (Intel 64 manual, volume 1, section 10.2.3), and its
    # place in `fenv_t`: the second word on macOS, on Linux behind the seven of the x87 unit.
    _FLUSH = _MASK = 0x8040
    _WORD = 1 if sys.platform == "darwin" else 7


@contextmanager
def flushed_subnormals() -> Iterator[None]:
    """The calling thread flushes subnormal numbers to zero, as Dr.Jit's threads do on this machine."""
    if platform.machine().lower() not in ("x86_64", "amd64"):
        yield
        return
    before = _exchange(_FLUSH)
    try:
        yield
    finally:
        _exchange(before)


def _exchange(bits: int) -> int:
    """Sets how the calling thread treats subnormal numbers; returns how it did."""
    library = _c_library()
    if sys.platform == "win32":
        control = ctypes.c_uint()
        library._controlfp_s(ctypes.byref(control), 0, 0)
        before = control.value
        library._controlfp_s(ctypes.byref(control), bits, _MASK)
        return before & _MASK
    environment = (ctypes.c_uint32 * 16)()  # fenv_t, which is shorter
    library.fegetenv(environment)
    before = int(environment[_WORD])
    environment[_WORD] = before & ~_MASK | bits
    library.fesetenv(environment)
    return before & _MASK


@cache
def _c_library() -> ctypes.CDLL:
    return ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None)
