"""What a render asks for beyond the scene, and the checks of it (document, sections 7 and 8)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any, Literal, cast

from tracer.aovs import NAMES
from tracer.canvas import Canvas
from tracer.errors import UsageError
from tracer.given_scene import given_scene
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
        aovs = self._checked_aovs()
        threshold = self._checked_threshold()
        self._check_numbers()
        return Settings(**(vars(self) | {"aovs": aovs, "threshold": threshold}))

    def _checked_aovs(self) -> tuple[str, ...]:
        try:
            aovs = (self.aovs,) if isinstance(self.aovs, str) else tuple(dict.fromkeys(self.aovs))
        except TypeError:
            raise UsageError(f"aovs: {self.aovs!r} is no list of names") from None
        known = ["depth", *NAMES]
        if "all" in aovs:
            aovs = tuple(known)
        for name in aovs:
            if name not in known:
                raise UsageError(f"aov: {name!r} is unknown; allowed are {', '.join(known)} and all")
        return aovs

    def _check_numbers(self) -> None:
        scale: Any = self.scale
        if not (isinstance(scale, Real) and math.isfinite(scale) and float(scale) > 0):
            raise UsageError(f"scale: {scale} is out of range; allowed is a number above 0")
        for name in ("threads", "memory", "rays_per_band"):
            value = getattr(self, name)
            if value is not None and not _are_whole([value], 1, 1):
                raise UsageError(f"{name}: {value} is out of range; allowed is a whole number, 1 or more")
        for name, count, least in (("resolution", 2, 1), ("crop", 4, None)):
            value = getattr(self, name)
            if value is not None and not _are_whole(value, count, least):
                limit = "" if least is None else f", {least} or more"
                raise UsageError(f"{name}: {value} is out of range; allowed are {count} whole numbers{limit}")

    def _checked_threshold(self) -> float | None:
        """That of an adaptive picture; checks the sub-rays."""
        n, threshold = self.supersample, cast(Any, self.threshold)
        if n == ADAPTIVE:
            threshold = ADAPTIVE_THRESHOLD if threshold is None else threshold
            if not (isinstance(threshold, Real) and 0 <= float(threshold) <= 1):
                raise UsageError(f"threshold: {threshold} is out of range; allowed is 0 to 1")
            return float(threshold)
        if n is not None and n not in range(1, LARGEST_SUPERSAMPLE + 1):
            raise UsageError(
                f"supersample: {n} is out of range; allowed is 1 to {LARGEST_SUPERSAMPLE}, or {ADAPTIVE}"
            )
        if threshold is not None:
            raise UsageError(f"threshold: {threshold} has a meaning only where supersample is {ADAPTIVE}")
        return None


def _are_whole(values: Any, count: int, least: int | None) -> bool:
    """Whether these are so many whole numbers, none below the least."""
    try:
        numbers = list(values)
    except TypeError:
        return False
    whole = len(numbers) == count and all(isinstance(number, Integral) for number in numbers)
    return whole and (least is None or min(numbers) >= least)


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
    """The scene with both its seeds replaced; raises `UsageError` for what is no scene."""
    scene = given_scene(scene)
    if seed is None:
        return scene
    scene = scene.model_copy(deep=True)
    scene.seed = seed
    if scene.camera.depth_of_field is not None:
        scene.camera.depth_of_field.seed = seed
    return scene
