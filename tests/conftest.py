"""What all tests share: a usable LLVM, and a Dr.Jit that each test finds as it was at the start."""

from __future__ import annotations

import functools
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from tracer.errors import MachineError
from tracer.llvm import ensure_llvm

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


def pytest_sessionstart() -> None:
    """Without a usable LLVM the run ends at once, with the sentence that users see.

    Processes that test side by side divide the cores among them: more threads than cores cost time.
    """
    try:
        ensure_llvm()
    except MachineError as error:
        pytest.exit(str(error), returncode=error.exit_code)
    import drjit as dr

    dr.set_thread_count(max(1, dr.thread_count() // int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))))


def pytest_report_header() -> str:
    """Names the LLVM in use: pictures may differ in the last bits from one to the next."""
    return f"backend: {ensure_llvm()}"


@pytest.fixture(autouse=True)
def _drjit_state() -> Iterator[None]:
    """Undoes what a test changed in Dr.Jit; compiled kernels stay, since compiling is what costs time."""
    import drjit as dr

    # Default is a sum of flags, and the scopes are Dr.Jit's own marks.
    inner = {dr.JitFlag.Default, dr.JitFlag.SymbolicScope, dr.JitFlag.FreezingScope}
    flags = {flag: dr.flag(flag) for flag in dr.JitFlag if flag not in inner}
    threads = dr.thread_count()
    yield
    dr.sync_thread()
    for flag, value in flags.items():
        dr.set_flag(flag, value)
    if dr.thread_count() != threads:
        dr.set_thread_count(threads)
    dr.kernel_history_clear()


def pytest_configure() -> None:
    """Code that a test changes is never answered for by what was made or recorded before."""
    for name in ("setattr", "delattr", "setitem", "delitem", "undo"):
        setattr(pytest.MonkeyPatch, name, _and_forget(getattr(pytest.MonkeyPatch, name)))


def _and_forget(change: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(change)
    def changed(*arguments: Any, **keywords: Any) -> Any:
        result = change(*arguments, **keywords)
        for module, forget in (("tracer.replay", "forget_recordings"), ("tracer.cache", "forget_everything")):
            if module in sys.modules:
                getattr(sys.modules[module], forget)()
        return result

    return changed


@pytest.fixture(scope="session")
def repository() -> Path:
    """The root of the repository."""
    return Path(__file__).resolve().parents[1]
