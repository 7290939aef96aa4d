"""What this machine has, what it lacks, and the command that mends it.

Works without any LLVM and without mitsuba: versions come from the installed packages' metadata, and the
backends are tried in a child process, so that a broken driver cannot take the report down.
"""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
from typing import Any

from tracer.errors import MachineError
from tracer.llvm import VARIABLE, LlvmLibrary, find_llvm
from tracer.llvm_search import install_hint

DISTRIBUTION = "whitted-tracer"
VIEWER_LIBRARIES = ("starlette", "uvicorn", "websockets")
"""What the extra `viewer` installs."""

_PACKAGES = ("drjit", "mitsuba", "numpy", "pydantic", "opencv-python-headless", "OpenEXR")
_TRY_BACKENDS = """
import json, sys
import drjit as dr
dr.sync_thread()  # waits until Dr.Jit has started, as tracer.llvm.start_drjit explains
def works(name):
    module = __import__(f"drjit.{name}", fromlist=["Float"])
    return dr.sum(dr.maximum(dr.arange(module.Float, 3), module.Float(1)))[0] == 4
cuda = bool(dr.has_backend(dr.JitBackend.CUDA))
print(json.dumps({
    "llvm_version": list(dr.detail.llvm_version()),
    "cuda_version": list(dr.detail.cuda_version()) if cuda else None,
    "llvm": "llvm" in sys.argv and bool(works("llvm")),
    "cuda": cuda and bool(works("cuda")),
}))
"""


def diagnose() -> dict[str, Any]:
    """Versions, backends and gaps of this machine, as plain data for `--json`.

    `missing` lists what is absent: `what`, `needed_for`, `required` (without it nothing renders), `command`.
    """
    try:
        library: LlvmLibrary | None = find_llvm()
        llvm_error = None
    except MachineError as error:
        library, llvm_error = None, str(error)
    tried = _try_backends(library)
    if library is not None and not tried.get("llvm"):
        llvm_error = f"{library} was found, but a test kernel failed on it{_because(tried)}"
    report: dict[str, Any] = {
        "tracer": _version(DISTRIBUTION),
        "python": platform.python_version(),
        "system": platform.platform(),
        "cores": cores(),
        "packages": {name: _version(name) for name in _PACKAGES},
        "llvm": {
            "works": bool(tried.get("llvm")),
            "path": str(library.path) if library else None,
            "version": _dotted(tried["llvm_version"] if tried.get("llvm") else library and library.version),
            "error": llvm_error,
        },
        "cuda": {"works": bool(tried.get("cuda")), "version": _dotted(tried.get("cuda_version"))},
        "povray": _povray_version(),
    }
    return {**report, "missing": _missing(report)}


def format_report(report: dict[str, Any]) -> str:
    """The report of `diagnose` as text for a terminal, without a newline at the end."""
    llvm, cuda = report["llvm"], report["cuda"]
    rows = [
        ("tracer", report["tracer"]),
        ("Python", f"{report['python']} on {report['system']}"),
        ("cores", report["cores"]),
        ("LLVM", f"{llvm['version']} ({llvm['path']})" if llvm["works"] else f"not usable: {llvm['error']}"),
        ("CUDA", f"driver {cuda['version']}" if cuda["works"] else "no GPU with a working driver"),
        *report["packages"].items(),
        ("POV-Ray", report["povray"]),
    ]
    lines = [f"{name:<24}{'not installed' if value is None else value}" for name, value in rows]
    for gap in report["missing"]:
        kind = "MISSING" if gap["required"] else "optional"
        lines.append(f"{kind}: {gap['what']}, needed for {gap['needed_for']}; to mend it: {gap['command']}")
    if not any(gap["required"] for gap in report["missing"]):
        lines.append("Everything that rendering needs is here.")
    return "\n".join(lines)


def _missing(report: dict[str, Any]) -> list[dict[str, Any]]:
    gaps = []
    for name, needed_for in (("drjit", "rendering"), ("mitsuba", "`tracer validate`")):
        requirement = _requirement(name)
        installed = report["packages"][name]
        wanted = requirement.partition("==")[2]
        if installed is None or (wanted and installed != wanted):
            what = requirement if installed is None else f"{requirement} (here is {installed})"
            command = f"{sys.executable} -m pip install {requirement}"
            gaps.append(_gap(what, needed_for, name == "drjit", command))
    if not report["llvm"]["works"] and report["packages"]["drjit"] is not None:
        required = not report["cuda"]["works"]
        command = _llvm_remedy(report["llvm"])
        gaps.append(_gap("LLVM 17 or newer", "rendering on the processor", required, command))
    if report["povray"] is None:
        gaps.append(_gap("POV-Ray", "a comparison in `tracer bench`", False, "install the package povray"))
    absent = [name for name in VIEWER_LIBRARIES if _version(name) is None]
    if absent:
        command = shlex.join([sys.executable, "-m", "pip", "install", *map(_requirement, absent)])
        gaps.append(_gap(" and ".join(absent), "`tracer view`", False, command))
    return gaps


def _llvm_remedy(llvm: dict[str, Any]) -> str:
    if os.environ.get(VARIABLE):
        return f"unset {VARIABLE} or correct it"
    return f"set {VARIABLE} to another LLVM" if llvm["path"] else install_hint()


def _gap(what: str, needed_for: str, required: bool, command: str) -> dict[str, Any]:
    return {"what": what, "needed_for": needed_for, "required": required, "command": command}


def _try_backends(library: LlvmLibrary | None) -> dict[str, Any]:
    """Runs one tiny kernel on each backend in a child process; without a usable LLVM it tries CUDA alone."""
    environment = {**os.environ, **({VARIABLE: str(library.path)} if library else {})}
    command = [sys.executable, "-c", _TRY_BACKENDS, *(["llvm"] if library else [])]
    try:
        child = subprocess.run(
            command, capture_output=True, stdin=subprocess.DEVNULL, text=True, timeout=120, env=environment
        )
        answer: dict[str, Any] = json.loads(child.stdout.splitlines()[-1]) if child.returncode == 0 else {}
    except subprocess.TimeoutExpired:
        return {"error": "it took longer than two minutes"}
    return answer or {"error": (child.stderr.strip().splitlines() or ["no message"])[-1]}


def _because(tried: dict[str, Any]) -> str:
    return f" ({tried['error']})" if "error" in tried else ""


def _version(distribution: str) -> str | None:
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return None


def _requirement(package: str) -> str:
    """This distribution's requirement on a package, such as `mitsuba==3.9.1`; the bare name if unknown."""
    try:
        requirements = importlib.metadata.requires(DISTRIBUTION) or []
    except importlib.metadata.PackageNotFoundError:
        requirements = []
    names = (requirement.partition(";")[0].strip() for requirement in requirements)
    return next((name for name in names if re.match(rf"{package}\b", name)), package)


def cores() -> int:
    """Processor cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _dotted(version: Any) -> str | None:
    return ".".join(map(str, version)) if version else None


def _povray_version() -> str | None:
    """POV-Ray's version where the program is on the path."""
    program = shutil.which("povray")
    if program is None:
        return None
    try:
        child = subprocess.run(
            [program, "--version"], capture_output=True, stdin=subprocess.DEVNULL, text=True, timeout=20
        )
    except (OSError, subprocess.TimeoutExpired):
        return "installed, but does not answer"
    match = re.search(r"POV-Ray\s+v?(\d[\w.]*)", child.stdout + child.stderr)
    return match.group(1) if match else "installed, version unknown"
