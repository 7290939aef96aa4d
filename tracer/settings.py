"""What a render asks for beyond the scene, and the checks of it (document, sections 7 and 8)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from tracer.aovs import NAMES
from tracer.canvas import Canvas
from tracer.errors import UsageError
from tracer.scene import Scene
from tracer.tiles import Rectangle

RAYS_PER_BAND = 1 << 21
"""Primary rays of a launch: enough to fill a GPU, few enough for progress and an answer to Ctrl-C."""

LARGEST_SUPERSAMPLE = 64

ADAPTIVE: Literal["adaptive"] = "adaptive"
"""In place of a number of sub-rays: all of them only where neighbors differ."""

ADAPTIVE_GRID = 3
"""n of an adaptive picture where the scene asks for one ray a pixel."""

ADAPTIVE_THRESHOLD = 0.015
"""By which display values of neighbors differ where all sub-rays are traced: 99 of 100 pixels of the built-in
rooms are then within 1/255 of the full grid (`docs/adaptive.md`)."""


@dataclass(frozen=True)
class Settings:
    """What a render asks for beyond the scene; see `tracer.render`."""

    precision: str = "single"
    backend: str = "auto"
    supersample: int | Literal["adaptive"] | None = None
    aovs: Sequence[str] = ("depth",)
    scale: float = 1.0
    resolution: tuple[int, int] | None = None
    crop: Rectangle | None = None
    threads: int | None = None
    seed: int | None = None
    rays_per_band: int = RAYS_PER_BAND
    memory: int | None = None
    count_hits: bool = False
    threshold: float | None = None
    animated: bool = False

    @property
    def adaptive(self) -> bool:
        """Whether only pixels that differ from their neighbors get all their sub-rays."""
        return self.supersample == ADAPTIVE

    def grid(self, scene: Scene) -> int:
        """n: a pixel is the mean of at most n x n sub-rays."""
        own = scene.camera.supersample
        if self.adaptive:
            return own if own > 1 else ADAPTIVE_GRID
        return int(self.supersample or own)

    def checked(self) -> Settings:
        """The settings with AOV names, each once, and the threshold spelled out; raises `UsageError`."""
        aovs = (self.aovs,) if isinstance(self.aovs, str) else tuple(dict.fromkeys(self.aovs))
        known = ["depth", *NAMES]
        if "all" in aovs:
            aovs = tuple(known)
        for name in aovs:
            if name not in known:
                raise UsageError(f"aov: {name!r} is unknown; allowed are {', '.join(known)} and all")
        threshold = self._checked_threshold()
        if not (math.isfinite(self.scale) and self.scale > 0):
            raise UsageError(f"scale: {self.scale} is out of range; allowed is a number above 0")
        if self.threads is not None and self.threads < 1:
            raise UsageError(f"threads: {self.threads} is out of range; allowed is 1 or more")
        if self.memory is not None and self.memory < 1:
            raise UsageError(f"memory: {self.memory} is out of range; allowed is 1 byte or more")
        if self.resolution is not None and min(self.resolution) < 1:
            raise UsageError(f"resolution: {self.resolution} is out of range; allowed is 1 or more")
        return Settings(**(vars(self) | {"aovs": aovs, "threshold": threshold}))

    def _checked_threshold(self) -> float | None:
        """That of an adaptive picture; checks the sub-rays."""
        n, threshold = self.supersample, self.threshold
        if n == ADAPTIVE:
            threshold = ADAPTIVE_THRESHOLD if threshold is None else float(threshold)
            if not 0 <= threshold <= 1:
                raise UsageError(f"threshold: {threshold} is out of range; allowed is 0 to 1")
            return threshold
        if n is not None and n not in range(1, LARGEST_SUPERSAMPLE + 1):
            raise UsageError(
                f"supersample: {n} is out of range; allowed is 1 to {LARGEST_SUPERSAMPLE}, or {ADAPTIVE}"
            )
        if threshold is not None:
            raise UsageError(f"threshold: {threshold} has a meaning only where supersample is {ADAPTIVE}")
        return None


def picture_canvas(scene: Scene, settings: Settings) -> Canvas:
    """The canvas in the resolution asked for."""
    canvas = Canvas.of(scene.camera, scene.literal)
    if settings.resolution is not None:
        canvas = canvas.resized(*settings.resolution)
    if settings.scale != 1:
        canvas = canvas.scaled(settings.scale)
    if canvas.width * canvas.height > 2**30:
        raise UsageError(f"resolution: {canvas.width} x {canvas.height} pixels; allowed are 2^30 in all")
    return canvas


def picture_rectangle(crop: Rectangle | None, canvas: Canvas) -> Rectangle:
    """The pixels asked for; raises `UsageError` for a crop that leaves the picture."""
    if crop is None:
        return (0, 0, canvas.width, canvas.height)
    x0, y0, x1, y1 = crop
    if not (0 <= x0 < x1 <= canvas.width and 0 <= y0 < y1 <= canvas.height):
        raise UsageError(
            f"crop: {x0} {y0} {x1} {y1} is empty or leaves the picture; "
            f"allowed is 0 <= X0 < X1 <= {canvas.width} and 0 <= Y0 < Y1 <= {canvas.height}"
        )
    return (x0, y0, x1, y1)


def with_seed(scene: Scene, seed: int | None) -> Scene:
    """The scene with both its seeds replaced."""
    if seed is None:
        return scene
    scene = scene.model_copy(deep=True)
    scene.seed = seed
    if scene.camera.depth_of_field is not None:
        scene.camera.depth_of_field.seed = seed
    return scene
