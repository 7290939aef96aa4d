"""Renders a scene: bands of pixels through the loop, then the filters (document, sections 7 to 9)."""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any

import drjit as dr
import numpy as np

from tracer.aovs import LAYERS, compute_layers
from tracer.backends import Backend, exact_arithmetic, find_backend, thread_count
from tracer.canvas import Canvas, DeviceCanvas
from tracer.color import encode_srgb
from tracer.device_scene import DeviceScene, compile_scene
from tracer.errors import UsageError
from tracer.film.depth_of_field import blur_reach, depth_of_field
from tracer.film.film import Film
from tracer.film.result import Result
from tracer.scene import Scene
from tracer.tiles import Band, Rectangle, bands, lane_pixels
from tracer.version import __version__
from tracer.whitted import Counts, PixelGrid, trace_pixels

RAYS_PER_BAND = 1 << 21
"""Primary rays of a launch: enough to fill a GPU, few enough for progress and an answer to Ctrl-C."""

COUNTERS = tuple(f.name for f in fields(Counts))

Progress = Callable[[int, int, int], None]
"""(finished pixels, all pixels, rays so far), called after every band."""


class RenderInterrupted(KeyboardInterrupt):
    """Ctrl-C during a render; `partial` holds the rows that were finished, the rest is blank."""

    def __init__(self, partial: Result) -> None:
        super().__init__("interrupted")
        self.partial = partial


@dataclass(frozen=True)
class Settings:
    """What a render asks for beyond the scene; see `render`."""

    precision: str = "single"
    backend: str = "auto"
    supersample: int | None = None
    aovs: tuple[str, ...] = ("depth",)
    scale: float = 1.0
    resolution: tuple[int, int] | None = None
    crop: Rectangle | None = None
    threads: int | None = None
    seed: int | None = None
    rays_per_band: int = RAYS_PER_BAND


def render(scene: Scene, *, progress: Progress | None = None, **settings: Any) -> Result:
    """Renders a scene.

    Args:
        scene: from `tracer.load` or built in code.
        precision: "single" (default) or "double".
        backend: "auto", "llvm" or "cuda".
        supersample: n >= 1 for n x n rays a pixel; None: as the scene says.
        aovs: names of layers, or "all": depth, normal, Ng, position, shape, primitive, uv.
        scale: size of the picture against the scene's resolution; the framing stays.
        resolution: (width, height) in pixels instead; the vertical extent of the canvas stays.
        crop: (x0, y0, x1, y1) in pixels of the full picture, end exclusive.
        threads: CPU threads (LLVM), None: all cores.
        seed: of jitter and depth of field; None: as the scene says.
        progress: called after every band with (finished pixels, all pixels, rays so far).

    Returns: `color` (h, w, 3) float32 (float64 in double precision), display-referred and not clamped; `depth` (h, w),
        distance from the canvas along the ray, -1 blank; `alpha`, `z`, `aovs`, `stats`.

    Raises: `UsageError`, `SceneError` for bad input, `MachineError` when the machine lacks the backend,
        `RenderInterrupted` on Ctrl-C.
    """
    unknown = set(settings) - {f.name for f in fields(Settings)}
    if unknown:
        raise TypeError(f"render() got an unexpected keyword argument {sorted(unknown)[0]!r}")
    wanted = _checked(Settings(**settings))
    backend = find_backend(wanted.backend, wanted.precision)
    with exact_arithmetic(), thread_count(wanted.threads):
        return _Job(_with_seed(scene, wanted.seed), wanted, backend, progress).run()


class _Job:
    """One render under way."""

    def __init__(
        self, scene: Scene, settings: Settings, backend: Backend, progress: Progress | None
    ) -> None:
        started = time.perf_counter()
        self.scene, self.settings, self.backend, self.progress = scene, settings, backend, progress
        self.canvas = _canvas(scene, settings)
        self.rectangle = _rectangle(settings.crop, self.canvas)
        self.n = settings.supersample or scene.camera.supersample
        self.layers = [name for name in settings.aovs if name != "depth"]
        self.device: DeviceScene = compile_scene(scene, backend)
        self.device_canvas = DeviceCanvas.of(backend, self.canvas)
        self.seconds = {"compile": time.perf_counter() - started, "trace": 0.0, "filter": 0.0}

    def run(self) -> Result:
        film = self._trace(self.rectangle)
        started = time.perf_counter()
        film = self._filtered(film)
        if self.scene.color_space == "linear":
            film.color = np.asarray(encode_srgb(film.color), self.backend.dtype)
        self.seconds["filter"] = time.perf_counter() - started
        return self._result(film)

    def _trace(self, rectangle: Rectangle) -> Film:
        """The first pass over a rectangle, band by band."""
        film = Film(rectangle, self.backend.dtype, dict.fromkeys(("primary", *COUNTERS), 0))
        started = time.perf_counter()
        x0, y0, x1, y1 = rectangle
        pixels = (x1 - x0) * (y1 - y0)
        try:
            for band in bands(rectangle, self.n**2, self.settings.rays_per_band):
                self._trace_band(film, band)
                if self.progress is not None:
                    self.progress((band.y1 - y0) * band.width, pixels, _ray_count(film.counts))
        except KeyboardInterrupt:
            raise RenderInterrupted(self._result(film)) from None
        self.seconds["trace"] += time.perf_counter() - started
        return film

    def _trace_band(self, film: Film, band: Band) -> None:
        backend = self.backend
        column, row, active = lane_pixels(backend, band)
        full_column = column + backend.opaque_id(band.x0)
        full_row = row + backend.opaque_id(band.y0)
        pixels = PixelGrid(
            column=full_column,
            row=full_row,
            number=full_row * backend.opaque_id(self.canvas.width) + full_column,
            n=backend.opaque_id(self.n),
            active=active,
        )
        found = trace_pixels(self.device, self.device_canvas, pixels)
        layers = {"color": found.color, "alpha": found.coverage, "depth": found.depth, "z": found.view_depth}
        if self.layers:
            dr.eval(found)
            layers |= compute_layers(self.device, self.device_canvas, pixels, found, self.layers)
        index = row * backend.opaque_id(band.width) + column
        picture = {name: _scattered(values, index, active, band) for name, values in layers.items()}
        totals = _totals(backend, found.counts)
        dr.eval(picture, totals)
        film.take(band, {name: values.numpy() for name, values in picture.items()})
        film.counts["primary"] += band.width * band.height * self.n**2
        for name, total in totals.items():
            merge = max if name == "deepest_level" else int.__add__
            film.counts[name] = merge(film.counts[name], int(total.numpy()[0]))

    def _filtered(self, film: Film) -> Film:
        """The film after the depth-of-field filter; a crop's first pass is widened to what the filter reads."""
        settings = self.scene.camera.depth_of_field
        if settings is None or settings.focus < 0:
            return film
        reach = blur_reach(film.depth, settings, self.canvas)
        x0, y0, x1, y1 = self.rectangle
        wide = (
            max(0, x0 - reach),
            max(0, y0 - reach),
            min(self.canvas.width, x1 + reach),
            min(self.canvas.height, y1 + reach),
        )
        source = film if wide == self.rectangle else self._trace(wide)
        film.color = depth_of_field(
            self.backend, source.color, source.depth, source.rectangle, self.rectangle, settings, self.canvas
        )
        return film

    def _result(self, film: Film) -> Result:
        scene, canvas = self.scene, self.canvas
        layers: dict[str, np.ndarray] = {"depth": film.depth} if "depth" in self.settings.aovs else {}
        return Result(
            color=film.color,
            depth=film.depth,
            alpha=film.alpha,
            z=film.z + self.backend.dtype(canvas.distance),
            aovs=layers | {name: film.arrays[name] for name in self.layers if name in film.arrays},
            stats=self._stats(film),
            scene_name=scene.name,
            scene_hash=scene_hash(scene),
            version=__version__,
            backend=self.backend.name,
            precision=self.backend.precision,
            seed=scene.seed,
            crop=film.rectangle,
            resolution=(canvas.width, canvas.height),
            background=scene.background,
            color_space=scene.color_space,
        )

    def _stats(self, film: Film) -> dict[str, Any]:
        counts = dict(film.counts)
        kinds = ("primary", "shadow", "reflected", "refracted", "total_reflection")
        return {
            "rays": {kind: counts.pop(kind) for kind in kinds},
            **counts,
            "seconds": dict(self.seconds),
            "pixels": int(film.depth.size),
            "supersample": self.n,
            "backend": self.backend.name,
            "precision": self.backend.precision,
        }


def _checked(settings: Settings) -> Settings:
    """The settings with AOV names spelled out; raises `UsageError`."""
    aovs = (settings.aovs,) if isinstance(settings.aovs, str) else tuple(settings.aovs)
    known = ["depth", *LAYERS]
    if "all" in aovs:
        aovs = tuple(known)
    for name in aovs:
        if name not in known:
            raise UsageError(f"aov: {name!r} is unknown; allowed are {', '.join(known)} and all")
    if settings.supersample is not None and not 1 <= settings.supersample <= 64:
        raise UsageError(f"supersample: {settings.supersample} is out of range; allowed is 1 to 64")
    if not (math.isfinite(settings.scale) and settings.scale > 0):
        raise UsageError(f"scale: {settings.scale} is out of range; allowed is a number above 0")
    if settings.threads is not None and settings.threads < 1:
        raise UsageError(f"threads: {settings.threads} is out of range; allowed is 1 or more")
    if settings.resolution is not None and min(settings.resolution) < 1:
        raise UsageError(f"resolution: {settings.resolution} is out of range; allowed is 1 or more")
    return Settings(**(vars(settings) | {"aovs": aovs}))


def _canvas(scene: Scene, settings: Settings) -> Canvas:
    canvas = Canvas.of(scene.camera, scene.literal)
    if settings.resolution is not None:
        canvas = canvas.resized(*settings.resolution)
    if settings.scale != 1:
        canvas = canvas.scaled(settings.scale)
    if canvas.width * canvas.height > 2**30:
        raise UsageError(f"resolution: {canvas.width} x {canvas.height} pixels; allowed are 2^30 in all")
    return canvas


def _rectangle(crop: Rectangle | None, canvas: Canvas) -> Rectangle:
    if crop is None:
        return (0, 0, canvas.width, canvas.height)
    x0, y0, x1, y1 = crop
    if not (0 <= x0 < x1 <= canvas.width and 0 <= y0 < y1 <= canvas.height):
        raise UsageError(
            f"crop: {x0} {y0} {x1} {y1} is empty or leaves the picture; allowed is 0 <= X0 < X1 <= {canvas.width} "
            f"and 0 <= Y0 < Y1 <= {canvas.height}"
        )
    return (x0, y0, x1, y1)


def _with_seed(scene: Scene, seed: int | None) -> Scene:
    """The scene with both its seeds replaced."""
    if seed is None:
        return scene
    scene = scene.model_copy(deep=True)
    scene.seed = seed
    if scene.camera.depth_of_field is not None:
        scene.camera.depth_of_field.seed = seed
    return scene


def scene_hash(scene: Scene) -> str:
    """SHA-256 of the scene's keys: equal scenes have equal hashes wherever they come from."""
    return hashlib.sha256(json.dumps(scene.to_dict(), sort_keys=True).encode()).hexdigest()


def _scattered(value: Any, index: Any, active: Any, band: Band) -> Any:
    """Values of lanes (components, n) in the order of the picture, components last.

    Each pixel is written by the one lane that owns it: no atomics.
    """
    components = [value] if dr.depth_v(value) == 1 else list(value)
    target = dr.empty(type(components[0]), band.width * band.height * len(components))
    for k, component in enumerate(components):
        dr.scatter(target, component, index * len(components) + k, active, mode=dr.ReduceMode.Permute)
    return target


def _totals(backend: Backend, counts: Counts) -> dict[str, Any]:
    """Sums over the lanes of a launch, 64 bits wide; of the levels the largest.

    Whole numbers, so the order in which the lanes add them makes no difference.
    """
    totals = {name: dr.zeros(backend.UInt64, 1) for name in COUNTERS}
    for name, total in totals.items():
        op = dr.ReduceOp.Max if name == "deepest_level" else dr.ReduceOp.Add
        dr.scatter_reduce(op, total, backend.UInt64(getattr(counts, name)), backend.UInt32(0))
    return totals


def _ray_count(counts: dict[str, int]) -> int:
    return sum(counts[kind] for kind in ("primary", "shadow", "reflected", "refracted", "total_reflection"))
