"""An LLVM that is missing or too old ends in one sentence and exit code 3, never in an abort.

Each case runs in a process of its own: which LLVM Dr.Jit uses is settled once, when `drjit` is imported.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tracer import llvm, llvm_search
from tracer.errors import MachineError

KERNEL = """
import sys
{before}
from tracer.llvm import ensure_llvm
from tracer.errors import MachineError
try:
    library = ensure_llvm()
except MachineError as error:
    print(error, file=sys.stderr)
    sys.exit(error.exit_code)
import drjit as dr
from drjit.llvm import Float
# The very operation on which LLVM 15 and 16 abort the process.
print(library.version[0], dr.sum(dr.maximum(dr.arange(Float, 100), Float(3)))[0])
"""


def run_kernel(
    repository: Path, library: Path | str | None, before: str = ""
) -> subprocess.CompletedProcess[str]:
    """Runs one kernel with `DRJIT_LIBLLVM_PATH` set so, `before` being executed ahead of the imports."""
    environment = {name: value for name, value in os.environ.items() if name != llvm.VARIABLE}
    if library is not None:
        environment[llvm.VARIABLE] = str(library)
    command = [sys.executable, "-c", KERNEL.format(before=before)]
    return subprocess.run(
        command, capture_output=True, text=True, env=environment, cwd=repository, timeout=120
    )


def old_library(major: int) -> Path:
    """An installed LLVM of that major version; skips the test where there is none."""
    for path, version in llvm_search.installed_files().items():
        if version[:1] == (major,):
            return path
    pytest.skip(f"LLVM {major} is not installed on this machine")


def test_the_newest_library_runs_the_kernel_that_old_ones_abort_on(repository: Path) -> None:
    done = run_kernel(repository, None)
    assert done.returncode == 0, done.stderr
    major, total = done.stdout.split()
    assert int(major) >= llvm.MINIMUM_MAJOR
    assert float(total) == sum(max(i, 3) for i in range(100))


@pytest.mark.parametrize("major", [14, 15, 16])
def test_a_library_that_is_too_old_ends_in_one_sentence(repository: Path, major: int) -> None:
    path = old_library(major)
    done = run_kernel(repository, path)
    assert done.returncode == 3
    assert done.stdout == ""
    assert done.stderr.splitlines() == [
        f"DRJIT_LIBLLVM_PATH names {path}, which is LLVM {major}, but LLVM 17 or newer is needed: "
        "set it to the file of a newer library, or unset it"
    ]


@pytest.mark.parametrize("major", [14, 15, 16])
def test_dr_jit_imported_too_early_with_an_old_library_does_not_abort(repository: Path, major: int) -> None:
    done = run_kernel(repository, old_library(major), before="import drjit")
    assert done.returncode == 3
    assert f"LLVM {major}" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize("question", ["tracer.llvm.ensure_llvm", "tracer.backends.has_cuda"])
def test_a_warning_while_dr_jit_starts_does_not_hang_the_process(repository: Path, question: str) -> None:
    # Dr.Jit warns from a thread of its own. Here that takes a second, in which the main thread asks.
    program = f"""
import importlib, os, sys, time
import tracer.llvm
class SlowError:
    def write(self, text):
        time.sleep(seconds.pop() if seconds else 0)
    def flush(self):
        pass
seconds = [1]
sys.stderr = SlowError()
os.environ[tracer.llvm.VARIABLE] = "no library"
module, _, name = "{question}".rpartition(".")
try:
    getattr(importlib.import_module(module), name)()
except tracer.MachineError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", program], text=True, cwd=repository, timeout=120)
    assert done.returncode == 0


def test_an_old_library_taken_before_tracer_came_is_named(repository: Path) -> None:
    # The variable is gone again when tracer looks, so that a newer library is there, but not in use.
    before = "import os, drjit; del os.environ['DRJIT_LIBLLVM_PATH']"
    done = run_kernel(repository, old_library(15), before)
    assert done.returncode == 3
    assert done.stderr.startswith(
        "Dr.Jit was imported before tracer and took LLVM 15, but 17 or newer is needed"
    )


def test_a_path_that_does_not_exist_is_named_without_further_noise(repository: Path, tmp_path: Path) -> None:
    path = tmp_path / "libLLVM.so"
    done = run_kernel(repository, path)
    assert done.returncode == 3
    assert done.stderr.splitlines() == [
        f"DRJIT_LIBLLVM_PATH names {path}, which does not exist: "
        "set it to the file of an LLVM library, or unset it"
    ]


def test_a_name_without_version_is_asked(repository: Path, tmp_path: Path) -> None:
    newest = llvm.find_llvm()
    assert newest.path is not None
    nameless = tmp_path / "compiler.so"
    shutil.copy(newest.path, nameless)
    done = run_kernel(repository, nameless)
    nameless.unlink()  # it is large
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.split()[0]) == newest.version[0]


def test_a_folder_or_another_file_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv(llvm.VARIABLE, str(tmp_path))
    with pytest.raises(MachineError, match="which is a folder"):
        llvm.find_llvm()
    other = tmp_path / "notes.txt"
    other.write_text("no library\n")
    monkeypatch.setenv(llvm.VARIABLE, str(other))
    with pytest.raises(MachineError, match="which does not load or tell its version"):
        llvm.find_llvm()


def test_without_any_library_the_sentence_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(llvm.VARIABLE, raising=False)
    monkeypatch.setattr(llvm_search, "search_folders", list)
    with pytest.raises(
        MachineError, match=r"needs LLVM 17 or newer, but none is installed here: .+ or set DRJIT_"
    ):
        llvm.find_llvm()


def test_the_newest_of_several_is_taken(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in ("libLLVM-9.so.1", "libLLVM-15.so.1", "libLLVM-17.so.1", "libLLVM.so.19.1", "libLLVM-18.so"):
        (tmp_path / name).touch()
    monkeypatch.delenv(llvm.VARIABLE, raising=False)
    monkeypatch.setattr(llvm_search, "search_folders", lambda: [tmp_path])
    monkeypatch.setattr(sys, "platform", "linux")
    assert llvm.find_llvm() == llvm.LlvmLibrary(tmp_path / "libLLVM.so.19.1", (19, 1))
    for name in ("libLLVM-17.so.1", "libLLVM.so.19.1", "libLLVM-18.so"):
        (tmp_path / name).unlink()
    with pytest.raises(MachineError, match=r"but the newest here is LLVM 15 \(.*libLLVM-15.so.1\)"):
        llvm.find_llvm()


@pytest.mark.parametrize(
    ("path", "version"),
    [
        ("/usr/lib/x86_64-linux-gnu/libLLVM.so.19.1", (19, 1)),  # Debian, Ubuntu, Arch
        ("/usr/lib/x86_64-linux-gnu/libLLVM-17.so.1", (17,)),
        ("/usr/lib/x86_64-linux-gnu/libLLVM-14.0.6.so.1", (14, 0, 6)),
        ("/usr/lib64/llvm19/lib/libLLVM.so", (19,)),  # Fedora
        ("/usr/lib64/libLLVM-18.so", (18,)),
        ("/opt/homebrew/Cellar/llvm/19.1.7/lib/libLLVM.dylib", (19, 1, 7)),
        ("/opt/homebrew/Cellar/llvm@18/18.1.8_1/lib/libLLVM.dylib", (18, 1, 8)),
        ("/opt/local/libexec/llvm-20/lib/libLLVM.dylib", (20,)),  # MacPorts
        ("C:/Program Files/LLVM/bin/LLVM-C.dll", ()),
        ("/usr/local/lib/libLLVM.so", ()),
    ],
)
def test_versions_in_names(path: str, version: tuple[int, ...]) -> None:
    assert llvm_search.named_version(Path(path)) == version
