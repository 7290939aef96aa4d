"""Renders a scene: bands of pixels through the loop, then the filters (document, sections 7 to 9)."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import partial
from typing import Any

import drjit as dr
import numpy as np

from tracer.aovs import NAMES, compute_layers
from tracer.backends import Backend, exact_arithmetic, find_backend, thread_count
from tracer.canvas import DeviceCanvas
from tracer.color import encode_srgb
from tracer.device_scene import DeviceScene, compile_scene
from tracer.film.depth_of_field import depth_of_field, rectangle_needed
from tracer.film.film import Film
from tracer.film.layout import VISIBILITY
from tracer.film.result import Result
from tracer.film.work_file import WorkFile
from tracer.first_hits import first_triangles
from tracer.kept_bands import KeptBands, identity_of
from tracer.memory import need_of, rays_that_fit
from tracer.pixels import BandPlace, pixels_of
from tracer.replay import Program
from tracer.scene import Scene
from tracer.scene.contents import snapshot
from tracer.settings import RAYS_PER_BAND, Settings, picture_canvas, picture_rectangle, with_seed
from tracer.tiles import Band, Rectangle, bands, lane_count
from tracer.version import __version__
from tracer.whitted import Counts, trace_pixels

COUNTERS = tuple(f.name for f in fields(Counts))

Progress = Callable[[int, int, int], None]
"""(finished pixels, all pixels, rays traced by this run), called at first and after every band."""


class RenderInterrupted(KeyboardInterrupt):
    """Ctrl-C during a render; `partial` holds the bands that were finished, the rest is blank."""

    def __init__(self, partial: Result) -> None:
        super().__init__("interrupted")
        self.partial = partial


def render(
    scene: Scene,
    precision: str = "single",
    backend: str = "auto",
    supersample: int | None = None,
    aovs: Sequence[str] = ("depth",),
    *,
    scale: float = 1.0,
    resolution: tuple[int, int] | None = None,
    crop: Rectangle | None = None,
    threads: int | None = None,
    seed: int | None = None,
    rays_per_band: int = RAYS_PER_BAND,
    memory: int | None = None,
    progress: Progress | None = None,
    work: WorkFile | None = None,
) -> Result:
    """Renders a scene.

    Args:
        scene: from `tracer.load` or built in code.
        precision: "single" or "double".
        backend: "auto" (CUDA where there is a GPU, else LLVM), "llvm" or "cuda".
        supersample: n for n x n rays a pixel, 1 to 64; None: as the scene says.
        aovs: names of layers, or "all"; `docs/layers.md` has the list.
        scale: size of the picture against the scene's resolution; the framing stays.
        resolution: (width, height) in pixels instead; the vertical extent of the canvas stays.
        crop: (x0, y0, x1, y1) in pixels of the full picture, end exclusive.
        threads: CPU threads (LLVM); None: all cores.
        seed: of jitter and depth of field; None: as the scene says.
        rays_per_band: primary rays of one launch at most; no picture depends on it.
        memory: bytes that the process may take, by an estimate made before the first ray: launches are made
            as small as necessary; None: all that the machine has.
        progress: called at first and after every launch with (finished pixels, all pixels, rays of this run).
        work: where finished bands are kept, and found again after an interruption; the caller removes it
            when the result is saved. Pictures of less than a second keep nothing.

    Returns: `color` (h, w, 3) float32 (float64 in double precision), display-referred and not clamped;
        `depth` (h, w), distance from the canvas along the ray, -1 blank; `alpha`, `z`, `aovs`, `stats`.

    Raises: `UsageError` and `SceneError` for bad input, `MachineError` when the machine lacks the backend
        or the memory,
        `OutputError` when the work file cannot be written, `RenderInterrupted` on Ctrl-C.
    """
    settings = Settings(
        precision, backend, supersample, aovs, scale, resolution, crop, threads, seed, rays_per_band, memory
    ).checked()
    types = find_backend(settings.backend, settings.precision)
    with exact_arithmetic(), thread_count(settings.threads):
        return _Job(with_seed(scene, settings.seed), settings, types, progress, work).run()


class _Job:
    """One render under way."""

    def __init__(
        self,
        scene: Scene,
        settings: Settings,
        backend: Backend,
        progress: Progress | None,
        work: WorkFile | None,
    ) -> None:
        started = time.perf_counter()
        self.scene, self.settings, self.backend, self.progress = scene, settings, backend, progress
        self.work = work
        self.canvas = picture_canvas(scene, settings)
        self.rectangle = picture_rectangle(settings.crop, self.canvas)
        self.n = settings.supersample or scene.camera.supersample
        self.layers = [name for name in settings.aovs if name in layers_of(scene)]
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
        with KeptBands(self.work, film, self._identity) as kept:
            remaining = kept.restore()
            earlier = _ray_count(film.counts)
            try:
                self._report(film, earlier)
                rays = self._rays_per_band(rectangle)
                for band in (band for rest in remaining for band in bands(rest, self.n**2, rays)):
                    self._trace_band(film, band)
                    kept.finished(band)
                    self._report(film, earlier)
            except KeyboardInterrupt:
                kept.finish()
                raise RenderInterrupted(self._result(film)) from None
        self.seconds["trace"] += kept.seconds + time.perf_counter() - started
        return film

    def _rays_per_band(self, rectangle: Rectangle) -> int:
        """As many as were asked for, or fewer, if memory is short."""
        x0, y0, x1, y1 = rectangle
        real, triangles = np.dtype(self.backend.dtype).itemsize, self.device.triangles is not None
        need = need_of(self.scene, self.layers, (x1 - x0) * (y1 - y0), real, triangles)
        return rays_that_fit(need, self.n**2, self.settings.memory, self.settings.rays_per_band)

    def _report(self, film: Film, earlier: int) -> None:
        if self.progress is not None:
            x0, y0, x1, y1 = film.rectangle
            self.progress(film.finished, (x1 - x0) * (y1 - y0), _ray_count(film.counts) - earlier)

    def _identity(self) -> dict[str, Any]:
        """What a work file must agree in."""
        return identity_of(self.scene, self.canvas, self.rectangle, self.backend, self.n, self.layers)

    def _trace_band(self, film: Film, band: Band) -> None:
        backend = self.backend
        place = BandPlace(
            x0=backend.opaque_id(band.x0),
            y0=backend.opaque_id(band.y0),
            width=backend.opaque_id(self.canvas.width),
            n=backend.opaque_id(self.n),
        )
        size = (band.width, band.height)
        first = first_triangles(self.device, self.canvas, self.device_canvas, place, size, self.n)
        found = trace_band(self.device, self.device_canvas, place, size, first, tuple(self.layers))
        totals = {name: int(found.pop(count_of(name)).numpy()[0]) for name in COUNTERS}
        film.take(band, {name: values.numpy() for name, values in found.items()})
        film.counts["primary"] += band.width * band.height * self.n**2
        for name, total in totals.items():
            merge = max if name == "deepest_level" else int.__add__
            film.counts[name] = merge(film.counts[name], total)

    def _filtered(self, film: Film) -> Film:
        """The film after the depth-of-field filter; a crop's first pass is widened to what the filter
        reads."""
        settings = self.scene.camera.depth_of_field
        if settings is None or settings.focus < 0:
            return film
        wide = rectangle_needed(self.rectangle, film.depth, settings, self.canvas)
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
            z=film.z,
            aovs=layers | {name: film.arrays[name] for name in self.layers if name in film.arrays},
            stats=self._stats(film),
            scene_name=scene.name,
            hash_of=partial(scene_hash, snapshot(scene)),
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


def layers_of(scene: Scene) -> list[str]:
    """The layers that a picture of the scene can have besides the depth; no visibility without lights."""
    return [name for name in NAMES if name != VISIBILITY or scene.lights]


def scene_hash(scene: Scene) -> str:
    """SHA-256 of the scene's keys: equal scenes have equal hashes wherever they come from."""
    return hashlib.sha256(json.dumps(scene.to_dict(), sort_keys=True).encode()).hexdigest()


@Program
def trace_band(
    device: DeviceScene,
    canvas: DeviceCanvas,
    place: BandPlace,
    size: tuple[int, int],
    first: Any,
    layers: tuple[str, ...],
) -> dict[str, Any]:
    """The layers of a band of `size` columns and rows, pixels in the order of the picture, components last,
    and the counters of `COUNTERS` (1,), each under its `count_of`. `first`: see `first_triangles`."""
    backend = device.backend
    pixels = pixels_of(backend, place, size, dr.arange(backend.UInt32, lane_count(*size)))
    found = trace_pixels(device, canvas, pixels, first, layers)
    values = {"color": found.color, "alpha": found.coverage, "depth": found.depth, "z": found.view_depth}
    if layers:
        values |= compute_layers(device, canvas, pixels, found, layers)
    index = (pixels.row - place.y0) * backend.opaque_id(size[0]) + (pixels.column - place.x0)
    picture = {name: _scattered(value, index, pixels.active, size) for name, value in values.items()}
    return picture | _totals(backend, found.counts)


def _scattered(value: Any, index: Any, active: Any, size: tuple[int, int]) -> Any:
    """Values of lanes (components, n) in the order of the picture, components last.

    Each pixel is written by the one lane that owns it: no atomics.
    """
    components = list(value) if isinstance(value, list) or dr.depth_v(value) > 1 else [value]
    target = dr.empty(type(components[0]), size[0] * size[1] * len(components))
    for k, component in enumerate(components):
        dr.scatter(target, component, index * len(components) + k, active, mode=dr.ReduceMode.Permute)
    return target


def _totals(backend: Backend, counts: Counts) -> dict[str, Any]:
    """Sums over the lanes of a launch, 64 bits wide; of the levels the largest.

    Whole numbers, so the order in which the lanes add them makes no difference.
    """
    totals = {count_of(name): dr.zeros(backend.UInt64, 1) for name in COUNTERS}
    for name in COUNTERS:
        op = dr.ReduceOp.Max if name == "deepest_level" else dr.ReduceOp.Add
        lanes = backend.UInt64(getattr(counts, name))
        dr.scatter_reduce(op, totals[count_of(name)], lanes, backend.UInt32(0))
    return totals


def count_of(name: str) -> str:
    """The name of a counter among the layers, some of which are called alike."""
    return f"number of {name}"


def _ray_count(counts: dict[str, int]) -> int:
    return sum(counts[kind] for kind in ("primary", "shadow", "reflected", "refracted", "total_reflection"))
