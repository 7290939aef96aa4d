"""Gives Dr.Jit the newest usable LLVM, before Dr.Jit looks for one by itself.

Dr.Jit 1.5 accepts LLVM 15 and 16, but its kernels then abort the whole process as soon as a minimum or a
maximum meets a scalar; 17 is the first version that works. Dr.Jit reads `DRJIT_LIBLLVM_PATH` once, while
`drjit` is being imported: `tracer/__init__.py` therefore calls `select_llvm` first of all, and whoever is
about to use the LLVM backend calls `ensure_llvm`.
"""

from __future__ import annotations

import importlib
import os
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from tracer.errors import MachineError
from tracer.llvm_search import Version, ask_version, install_hint, installed_files, named_version
from tracer.native_output import captured_stderr

MINIMUM_MAJOR = 17
VARIABLE = "DRJIT_LIBLLVM_PATH"


@dataclass(frozen=True)
class LlvmLibrary:
    """One LLVM library: its file (None where Dr.Jit chose it unasked) and its version, major number first."""

    path: Path | None
    version: Version

    @property
    def usable(self) -> bool:
        """True from LLVM 17 on."""
        return self.version[:1] >= (MINIMUM_MAJOR,)

    def __str__(self) -> str:
        name = f"LLVM {'.'.join(map(str, self.version))}"
        return name if self.path is None else f"{name} ({self.path})"


def find_llvm() -> LlvmLibrary:
    """The library to use: the one that `DRJIT_LIBLLVM_PATH` names, else the newest one in the usual folders.

    Raises `MachineError` with one sentence that says what helps when it is missing or older than LLVM 17.
    """
    chosen = os.environ.get(VARIABLE)
    if chosen:
        return _check_chosen(chosen)
    files = installed_files()
    libraries = [LlvmLibrary(path, version) for path, version in files.items() if version]
    newest = max(libraries, key=lambda library: library.version, default=None)
    if newest is not None and newest.usable:
        return newest
    for path in (path for path, version in files.items() if not version):
        asked = LlvmLibrary(path, ask_version(str(path)))
        if asked.usable:
            return asked
    found = f"the newest here is {newest}" if newest else "none is installed here"
    raise MachineError(
        f"the LLVM backend needs LLVM {MINIMUM_MAJOR} or newer, but {found}: {install_hint()}, "
        f"or set {VARIABLE} to the library's file"
    )


def select_llvm() -> None:
    """Points Dr.Jit to the library of `find_llvm`; to be called before the first import of `drjit`.

    Never raises, since CUDA and everything that renders nothing work without LLVM. Where no library is
    usable, it imports Dr.Jit without one and with its warnings silenced (a library that is too old must not
    even be started): `ensure_llvm` says the same in one sentence when it matters.
    """
    if "drjit" in sys.modules:
        return
    try:
        os.environ[VARIABLE] = str(find_llvm().path)
    except MachineError:
        chosen = os.environ.get(VARIABLE)
        os.environ[VARIABLE] = "no usable LLVM"
        try:
            with captured_stderr():
                start_drjit()
        finally:
            del os.environ[VARIABLE]
            if chosen is not None:
                os.environ[VARIABLE] = chosen


@cache
def start_drjit() -> None:
    """Imports Dr.Jit and waits until it has started, which it does in a thread of its own.

    That thread holds Dr.Jit's lock, and where LLVM is missing or too old it needs Python's for its warning.
    Whoever asks Dr.Jit anything meanwhile holds Python's lock and waits for Dr.Jit's: both stand still for
    ever; `sync_thread` waits without Python's lock.
    """
    importlib.import_module("drjit").sync_thread()


def ensure_llvm() -> LlvmLibrary:
    """Makes sure that Dr.Jit runs on LLVM 17 or newer, and says which one it is.

    Raises `MachineError` (exit code 3) before any kernel could abort the process. Dr.Jit itself has the last
    word, because a program that imported `drjit` before `tracer` has let it choose another library.
    """
    select_llvm()
    start_drjit()
    import drjit as dr

    chosen = os.environ.get(VARIABLE)
    loaded = LlvmLibrary(Path(chosen) if chosen else None, tuple(dr.detail.llvm_version()))
    if loaded.usable:
        return loaded
    available = find_llvm()
    if loaded.version[0] > 0:
        raise MachineError(
            f"Dr.Jit was imported before tracer and took LLVM {loaded.version[0]}, but {MINIMUM_MAJOR} or "
            f"newer is needed: import tracer first, or set {VARIABLE}={available.path}"
        )
    raise MachineError(
        f"Dr.Jit could not start {available}: import tracer before drjit, or set {VARIABLE} to an LLVM "
        f"{MINIMUM_MAJOR} or newer that fits this Python and processor"
    )


def _check_chosen(chosen: str) -> LlvmLibrary:
    """Checks the user's choice: a file, or a bare name that the system's loader resolves."""
    path = Path(chosen)
    bare = path.name == chosen
    if not bare and not path.is_file():
        found = "which is a folder" if path.is_dir() else "which does not exist"
        raise MachineError(
            f"{VARIABLE} names {chosen}, {found}: set it to the file of an LLVM library, or unset it"
        )
    version = named_version(path if bare else path.resolve()) or named_version(path) or ask_version(chosen)
    library = LlvmLibrary(path, version)
    if library.usable:
        return library
    found = f"which is LLVM {version[0]}" if version else "which does not load or tell its version"
    raise MachineError(
        f"{VARIABLE} names {chosen}, {found}, but LLVM {MINIMUM_MAJOR} or newer is needed: "
        "set it to the file of a newer library, or unset it"
    )
