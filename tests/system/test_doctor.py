"""The doctor tells what is there and what is missing, also where rendering cannot work."""

from __future__ import annotations

import importlib.metadata
import json
from pathlib import Path

import pytest

from tracer.doctor import diagnose, format_report
from tracer.llvm import VARIABLE, ensure_llvm


def test_a_healthy_machine() -> None:
    report = diagnose()
    assert report["llvm"]["works"]
    assert report["llvm"]["version"] == ".".join(map(str, ensure_llvm().version))
    assert report["packages"]["drjit"] == importlib.metadata.version("drjit")
    assert report["cores"] >= 1
    assert not any(gap["required"] for gap in report["missing"])
    assert "Everything that rendering needs is here." in format_report(report)
    assert json.loads(json.dumps(report)) == report


def test_without_a_usable_llvm_the_report_names_the_remedy(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "libLLVM.so"))
    report = diagnose()
    assert not report["llvm"]["works"]
    assert "which does not exist" in report["llvm"]["error"]
    gap = next(gap for gap in report["missing"] if gap["what"].startswith("LLVM"))
    assert gap["required"] is not report["cuda"]["works"]
    assert gap["command"] == f"unset {VARIABLE} or correct it"
    assert "LLVM 17 or newer, needed for rendering on the processor; to mend it: unset" in format_report(
        report
    )


def test_a_library_that_only_looks_right_is_found_out(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    library = tmp_path / "libLLVM.so.19.1"
    library.write_text("not a library\n")
    monkeypatch.setenv(VARIABLE, str(library))
    report = diagnose()
    assert not report["llvm"]["works"]
    assert "a test kernel failed on it" in report["llvm"]["error"]


def leave_out(package: str, patch: pytest.MonkeyPatch) -> None:
    """As if the package were not installed."""
    version = importlib.metadata.version

    def of_others(name: str) -> str:
        if name == package:
            raise importlib.metadata.PackageNotFoundError(name)
        return version(name)

    patch.setattr(importlib.metadata, "version", of_others)


def test_the_command_for_mitsuba_carries_the_version(monkeypatch: pytest.MonkeyPatch) -> None:
    leave_out("mitsuba", monkeypatch)
    gap = next(gap for gap in diagnose()["missing"] if gap["what"].startswith("mitsuba"))
    assert gap["command"].endswith("-m pip install mitsuba==3.9.1")
    assert not gap["required"]


def test_what_the_viewer_lacks_is_optional(monkeypatch: pytest.MonkeyPatch) -> None:
    leave_out("uvicorn", monkeypatch)
    gap = next(gap for gap in diagnose()["missing"] if gap["what"] == "uvicorn")
    assert gap["needed_for"] == "`tracer view`" and not gap["required"]
    assert "-m pip install" in gap["command"] and "uvicorn" in gap["command"]
