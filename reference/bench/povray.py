"""POV-Ray 3.7 as a program: the command, its own clock, its counts and its memory."""

from __future__ import annotations

import re
import shutil
import subprocess
import time
from dataclasses import dataclass
from math import isnan
from pathlib import Path

import cv2
import numpy as np

import tracer
from reference.bench.memory import high_water
from reference.povray.document import export_povray
from tracer.errors import MachineError

COUNTED = {
    "shadow": r"Shadow Ray Tests:\s+(\d+)",
    "reflected": r"Reflected Rays:\s+(\d+)",
    "refracted": r"(?:Refracted|Transmitted) Rays:\s+(\d+)",
}

WATCH = 0.005
"""Seconds between two looks at the memory."""


@dataclass(frozen=True)
class PovrayRun:
    """One process: the picture, seconds of tracing as it says and of the whole, rays, peak memory in MiB."""

    picture: np.ndarray
    trace: float
    whole: float
    rays: dict[str, int]
    peak: float


def find_povray() -> str | None:
    """The program, if it is on the path."""
    return shutil.which("povray")


class PovrayProgram:
    """A scene exported for POV-Ray, without antialiasing, on so many threads; it needs a folder."""

    def __init__(self, scene: tracer.Scene, folder: Path, threads: int) -> None:
        program = find_povray()
        if program is None:
            raise MachineError("POV-Ray is not installed")
        width, height = scene.camera.resolution
        self._folder, self._pixels = folder, width * height
        export_povray(scene, folder / "scene.pov")
        self._command = [program, "+Iscene.pov", f"+W{width}", f"+H{height}", "+Oscene-out.png"]
        self._command += [f"+WT{threads}", "-A", "-D", "-V", "+FN8"]
        self.last: PovrayRun

    def run(self, watched: bool = False) -> PovrayRun:
        """Renders the picture once; memory is NaN unless `watched`, which takes a little of the time. Raises
        `MachineError` where the program fails."""
        log = self._folder / "povray.log"
        started = time.perf_counter()
        with log.open("w") as stream:
            process = subprocess.Popen(
                self._command, cwd=self._folder, stdin=subprocess.DEVNULL, stdout=stream, stderr=stream
            )
            peak = _watch(process) if watched else float("nan")
            process.wait()
        whole = time.perf_counter() - started
        said = log.read_text("utf-8", errors="replace")
        if process.returncode != 0:
            raise MachineError(
                f"povray ended with code {process.returncode}: {said.strip().splitlines()[-1:]}"
            )
        picture = cv2.imread(str(self._folder / "scene-out.png"))
        assert picture is not None
        self.last = PovrayRun(
            picture=picture[..., ::-1].astype(np.float32) / 255,
            trace=float((re.findall(r"Trace Time:.*\(([\d.]+) seconds\)", said) or ["nan"])[0]),
            whole=whole,
            rays={"primary": self._pixels} | _counts(said),
            peak=peak,
        )
        return self.last


def _watch(process: subprocess.Popen[bytes]) -> float:
    """Looks again and again until the end, as POV-Ray does not say it; the most memory in MiB."""
    most = float("nan")
    while process.poll() is None:
        now = high_water(process.pid)
        most = most if isnan(now) else now  # a mark only rises; of a process that has ended there is none
        time.sleep(WATCH)
    return most


def _counts(said: str) -> dict[str, int]:
    counts = {kind: sum(map(int, re.findall(pattern, said))) for kind, pattern in COUNTED.items()}
    return {kind: count for kind, count in counts.items() if count}
