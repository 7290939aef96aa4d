"""What an animation is: frames, a scene over time, files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from tracer.cli.frame_names import FrameFiles
from tracer.scene import Scene


@dataclass(frozen=True)
class Course:
    """Which `frames` are rendered, and at how many frames a second their movie plays (`rate`)."""

    frames: range
    rate: float


@dataclass(frozen=True)
class View:
    """A scene over time: `at` gives the scene at a frame; `words` say what the camera does, the same words
    the same thing."""

    at: Callable[[int], Scene]
    words: str


@dataclass(frozen=True)
class Job:
    """One animation: its scene as the user called it and loaded, the scene over time, its files."""

    source: str
    scene: Scene
    view: View
    files: FrameFiles
