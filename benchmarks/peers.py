"""The renderers that `frame.py` times, behind one small interface.

A renderer is built once, then called for frames. A call returns the picture, float32 (h, w, 3),
display-referred. `Unavailable` says in one sentence what to install where a renderer is missing.
"""

from __future__ import annotations

import dataclasses
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, Protocol

import numpy as np

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

TILE = 8  # pixels: Mitsuba's Morton order needs a size that this divides
HERE = Path(__file__).resolve().parent
SCENE = HERE.parent / "scenes" / "room.toml"
POVRAY_SCENE = HERE / "room.pov"


class Unavailable(Exception):
    """The renderer is not installed here; the text says what helps."""


class Renderer(Protocol):
    """What `frame.py` needs of a renderer."""

    name: str
    uses_drjit: bool  # compiles kernels that `dr.kernel_history` sees

    def frame(self) -> np.ndarray: ...

    def rays(self) -> dict[str, int]:
        """Rays of one frame by kind; called after at least one frame."""
        ...

    def details(self) -> dict[str, Any]:
        """More about the last frame, in numbers that the renderer itself reports."""
        ...


def as_mapping(value: Any) -> dict[str, Any]:
    """A record (dictionary, dataclass or plain object) as a dictionary."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return dataclasses.asdict(value)
    return dict(value) if isinstance(value, dict) else dict(vars(value))


class Tracer:
    """This project's renderer, through its public interface."""

    uses_drjit = True

    def __init__(self, size: int) -> None:
        try:
            import tracer
        except ImportError as error:
            raise Unavailable(f"tracer cannot be imported ({error}): run `make setup`") from error
        if not (hasattr(tracer, "load") and hasattr(tracer, "render")):
            raise Unavailable("this version of tracer has no load and render")
        self.name = "tracer"
        with SCENE.open("rb") as file:
            record = tomllib.load(file)
        width, height = record["camera"]["resolution"]
        record["camera"]["resolution"] = [size, max(1, round(height * size / width))]
        record["camera"]["pixel_size"] *= width / size
        self._module = tracer
        self._scene = tracer.load(record, base_dir=SCENE.parent)
        self._stats: dict[str, Any] = {}

    def frame(self) -> np.ndarray:
        result = self._module.render(self._scene)
        self._stats = as_mapping(result.stats)
        return result.color

    def rays(self) -> dict[str, int]:
        return {kind: int(count) for kind, count in as_mapping(self._stats.get("rays", {})).items()}

    def details(self) -> dict[str, Any]:
        seconds = as_mapping(self._stats.get("seconds", {}))
        return {f"{phase} ms": 1e3 * value for phase, value in seconds.items()}


class Mitsuba:
    """Whitted's algorithm around Mitsuba's ray queries, see `mitsuba_whitted`."""

    uses_drjit = True

    def __init__(self, size: int, order: str = "morton", occlusion: str = "preliminary") -> None:
        try:
            from mitsuba_whitted import MitsubaWhitted
        except ImportError as error:
            raise Unavailable(f"Mitsuba cannot be imported ({error}): pip install mitsuba") from error
        self.name = f"mitsuba {order}" if occlusion == "preliminary" else f"mitsuba {order} ray_test"
        self._renderer = MitsubaWhitted(SCENE, size, order, occlusion)

    def frame(self) -> np.ndarray:
        return self._renderer.render()

    def rays(self) -> dict[str, int]:
        return dataclasses.asdict(self._renderer.count_rays())

    def details(self) -> dict[str, Any]:
        return {}


class Povray:
    """POV-Ray 3.7 as a process of its own; the time of a frame is that of the whole process."""

    name = "povray"
    uses_drjit = False

    def __init__(self, size: int, threads: int) -> None:
        program = shutil.which("povray")
        if program is None:
            raise Unavailable("POV-Ray 3.7 is not installed: apt install povray")
        self._folder = tempfile.TemporaryDirectory()
        self._picture = Path(self._folder.name) / "room.png"
        self._command = [program, f"+I{POVRAY_SCENE}", f"+W{size}", f"+H{size}", f"+O{self._picture}"]
        self._command += [f"+WT{threads}", "-A", "-D", "-V", "File_Gamma=1.0"]
        self._report = ""

    def frame(self) -> np.ndarray:
        import cv2

        done = subprocess.run(self._command, capture_output=True, text=True, cwd=self._folder.name)
        self._report = done.stderr
        if done.returncode != 0:
            raise RuntimeError(f"povray ended with code {done.returncode}: {done.stderr[-400:]}")
        picture = cv2.imread(str(self._picture))
        if picture is None:
            raise RuntimeError("povray wrote no picture that can be read")
        return picture[..., ::-1].astype(np.float32) / 255

    def rays(self) -> dict[str, int]:
        return {
            "all but shadow": self._number(r"Rays:\s+(\d+)"),
            "reflected": self._number(r"Reflected Rays:\s+(\d+)"),
            "refracted": self._number(r"Refracted Rays:\s+(\d+)"),
            "shadow": self._number(r"Shadow Ray Tests:\s+(\d+)"),
        }

    def details(self) -> dict[str, Any]:
        seconds = re.search(r"Trace Time:.*\(([\d.]+) seconds\)", self._report)
        return {"trace ms": 1e3 * float(seconds.group(1))} if seconds else {}

    def _number(self, pattern: str) -> int:
        found = re.search(pattern, self._report)
        return int(found.group(1)) if found else 0
