"""What the user asks for by the options that all renders share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from tracer.cli.failures import talk


@dataclass(frozen=True)
class Wishes:
    """What `scene_options` and `picture_options` ask for, as click delivers it."""

    outputs: tuple[str, ...]
    overrides: tuple[str, ...]
    allow_outside: bool
    scale: float
    resolution: tuple[int, int] | None
    supersample: int | Literal["adaptive"] | None
    threshold: float | None
    crop: tuple[int, int, int, int] | None
    precision: str
    backend: str
    threads: int | None
    aovs: tuple[str, ...]
    aov_png: bool
    bits: str
    alpha: bool
    half: bool
    seed: int | None
    memory: int | None
    resume: bool
    stats: bool
    quiet: bool
    progress: str

    @property
    def settings(self) -> dict[str, Any]:
        """The arguments of `tracer.render`."""
        names = (
            "scale",
            "resolution",
            "supersample",
            "threshold",
            "crop",
            "precision",
            "backend",
            "threads",
            "seed",
            "memory",
        )
        settings = {name: getattr(self, name) for name in names}
        return settings | {"aovs": ("depth", *self.aovs), "count_hits": self.stats}

    @property
    def file_options(self) -> dict[str, Any]:
        """The arguments of `Result.save`."""
        return {"bits": int(self.bits), "alpha": self.alpha, "half": self.half}

    @property
    def reporter(self) -> str:
        """Which kind of progress is shown."""
        return "none" if self.quiet and self.progress == "auto" else self.progress


def warn(text: str, wishes: Wishes) -> None:
    """Says what is allowed and probably a mistake, unless nothing is to be said."""
    if not wishes.quiet:
        talk(f"warning: {text}")
