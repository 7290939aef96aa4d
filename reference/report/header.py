"""With what a run was made: versions, machine, settings, and the command that repeats it."""

from __future__ import annotations

import importlib.metadata
import platform
import re
import shutil
import subprocess
from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path

import tracer
from reference.mitsuba_variant import mitsuba
from tracer.doctor import DISTRIBUTION, cores
from tracer.errors import MachineError
from tracer.llvm import ensure_llvm

COMMAND = "command to repeat"
"""The last name of a header."""


def header_of(command: str, precisions: Sequence[str], backend: str, rays: int, seed: int) -> dict[str, str]:
    """Name and value, in the order of a report; `rays` are those of a scene. Raises `MachineError` without
    Mitsuba or LLVM."""
    mitsuba()
    return machine_facts() | {
        "backend": backend,
        "precisions" if len(precisions) > 1 else "precision": ", ".join(precisions),
        "rays a scene": f"{rays:,}",
        "seed": str(seed),
        COMMAND: command,
    }


def machine_facts() -> dict[str, str]:
    """When, with which versions and on what machine; without Mitsuba where it is not installed. Raises
    `MachineError` without LLVM."""
    ensure_llvm()
    import drjit as dr  # not before an LLVM was chosen for it

    commit = _commit(Path(tracer.__file__).resolve().parents[1])
    return {
        "date": datetime.now(timezone.utc).strftime("%Y-%m-%d %H:%M UTC"),
        "tracer": importlib.metadata.version(DISTRIBUTION),
        **({"commit": commit} if commit else {}),
        **_mitsuba(),
        "Dr.Jit": importlib.metadata.version("drjit"),
        "LLVM": ".".join(map(str, dr.detail.llvm_version())),
        "NumPy": importlib.metadata.version("numpy"),
        "Python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "processor": _processor(),
        "GPU": _gpu(),
    }


def _mitsuba() -> dict[str, str]:
    try:
        other = mitsuba()
    except MachineError:
        return {}
    return {"Mitsuba": f"{other.__version__}, {other.variant()}"}


def _commit(root: Path) -> str:
    """The short hash of a checkout, with a word on changes since then; empty for an installed package."""
    if not (root / ".git").exists():
        return ""
    commit = _said("git", "-C", str(root), "rev-parse", "--short", "HEAD")
    changed = _said("git", "-C", str(root), "status", "--porcelain", "--untracked-files=no")
    return f"{commit} + changes" if commit and changed else commit


def _processor() -> str:
    """The model's name, and how many cores this process may use."""
    try:
        named = re.search(r"^model name\s*:\s*(.+)$", Path("/proc/cpuinfo").read_text("utf-8"), re.MULTILINE)
    except OSError:
        named = None
    name = named.group(1).strip() if named else platform.processor() or platform.machine()
    count = cores()
    return f"{name}, {count} core{'s' if count > 1 else ''}"


def _gpu() -> str:
    """The name of the first NVIDIA GPU."""
    names = _said("nvidia-smi", "--query-gpu=name", "--format=csv,noheader").splitlines()
    return names[0].strip() if names else "none"


def _said(*command: str) -> str:
    """What a program prints; empty where it is missing or fails."""
    if shutil.which(command[0]) is None:
        return ""
    try:
        done = subprocess.run(
            command, capture_output=True, stdin=subprocess.DEVNULL, text=True, timeout=20, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip()
