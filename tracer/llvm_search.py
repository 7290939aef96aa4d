"""Where LLVM libraries lie on each system, and which version a file is.

Versions are read from file names (microseconds). Only a name without a version, such as `LLVM-C.dll`, makes a
short-lived child process load the library and ask it: two LLVMs in one process disturb each other.
"""

from __future__ import annotations

import os
import platform
import re
import subprocess
import sys
from pathlib import Path

Version = tuple[int, ...]

_FILE_PATTERNS = {"win32": ("LLVM-C*.dll",), "darwin": ("libLLVM.dylib", "libLLVM-*.dylib")}
_FILE_VERSION = re.compile(r"libLLVM(?:\.so\.|-|\.)(\d+)(?:\.(\d+))?(?:\.(\d+))?(?!\w)")
_FOLDER_VERSION = re.compile(r"[/\\]llvm(?:@\d+[/\\]|[-/\\])?(\d+)(?:\.(\d+))?(?:\.(\d+))?[^/\\]*[/\\]")
_ASK = """
import ctypes, sys
version = [ctypes.c_uint() for _ in range(3)]
ctypes.CDLL(sys.argv[1]).LLVMGetVersion(*map(ctypes.byref, version))
print(*(number.value for number in version))
"""


def installed_files() -> dict[Path, Version]:
    """Every LLVM library in the usual folders with its version, which is empty where no name tells it."""
    patterns = _FILE_PATTERNS.get(sys.platform, ("libLLVM.so*", "libLLVM-*.so*"))
    files = {
        file.resolve(): file
        for folder in search_folders()
        for pattern in patterns
        for file in folder.glob(pattern)
        if file.is_file()
    }
    return {target: named_version(target) or named_version(file) for target, file in files.items()}


def search_folders() -> list[Path]:
    """The folders where Debian, Ubuntu, Fedora, Arch, conda, Homebrew, MacPorts and Windows keep LLVM."""
    conda = [Path(prefix) for prefix in (sys.prefix, os.environ.get("CONDA_PREFIX")) if prefix]
    if sys.platform == "win32":
        programs = Path(os.environ.get("PROGRAMFILES", "C:/Program Files")) / "LLVM" / "bin"
        return [*(prefix / "Library" / "bin" for prefix in conda), programs, *_folders_of("PATH")]
    libraries = [prefix / "lib" for prefix in conda]
    if sys.platform == "darwin":
        brew, ports = ("/opt/homebrew/opt", "/usr/local/opt"), "/opt/local/libexec"
        roots = {**dict.fromkeys(brew, "llvm*/lib"), ports: "llvm-*/lib"}
        return [*_folders_of("DYLD_LIBRARY_PATH"), *libraries, *_glob(roots), Path("/usr/local/lib")]
    roots = {"/usr/lib": "llvm*/lib*", "/usr/lib64": "llvm*/lib*"}
    system = [f"/usr/lib/{platform.machine()}-linux-gnu", "/usr/lib64", "/usr/lib", "/usr/local/lib"]
    return [*_folders_of("LD_LIBRARY_PATH"), *libraries, *_glob(roots), *map(Path, system)]


def named_version(path: Path) -> Version:
    """The version in the file's name or its folder's (`Cellar/llvm/19.1.7/lib`); empty if neither has one."""
    match = _FILE_VERSION.search(path.name) or _FOLDER_VERSION.search(str(path))
    return tuple(int(number) for number in match.groups() if number) if match else ()


def ask_version(name: str) -> Version:
    """What the library itself says; empty where it cannot be loaded or is older than LLVM 16."""
    command = [sys.executable, "-c", _ASK, name]
    try:
        answer = subprocess.run(command, capture_output=True, stdin=subprocess.DEVNULL, text=True, timeout=60)
    except (OSError, subprocess.TimeoutExpired):
        return ()
    return tuple(map(int, answer.stdout.split())) if answer.returncode == 0 else ()


def install_hint() -> str:
    """What to type on this system to get a usable LLVM, in the imperative."""
    if sys.platform == "win32":
        return "install LLVM for Windows, which brings LLVM-C.dll"
    if sys.platform == "darwin":
        return "run `brew install llvm`"
    try:
        release = platform.freedesktop_os_release()
    except OSError:
        release = {}
    if release.get("ID") == "ubuntu" and release.get("VERSION_ID", "") < "24.04":
        return "this Ubuntu offers no newer one, so take it from LLVM's apt repository or from conda-forge"
    commands = {
        "debian": "apt-get install libllvm19",
        "fedora": "dnf install llvm-libs",
        "arch": "pacman -S llvm-libs",
    }
    for system in (release.get("ID", ""), *release.get("ID_LIKE", "").split()):
        if system in commands:
            return f"run `{commands[system]}` as root"
    return "install it with the package manager of this system"


def _folders_of(variable: str) -> list[Path]:
    return [Path(folder) for folder in os.environ.get(variable, "").split(os.pathsep) if folder]


def _glob(roots: dict[str, str]) -> list[Path]:
    return [folder for root, pattern in roots.items() for folder in Path(root).glob(pattern)]
