"""Passes over a picture: a rectangle of it is cut into bands, and each is traced, kept and reported."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from tracer.aovs import NAMES
from tracer.backends import Backend
from tracer.canvas import DeviceCanvas
from tracer.device_scene import compile_scene
from tracer.film.counts import number_of_rays, together
from tracer.film.film import Film
from tracer.film.layout import VISIBILITY
from tracer.film.work_file import WorkFile
from tracer.first_hits import enough_for_bundles, first_hits
from tracer.kept_bands import KeptBands, identity_of
from tracer.launch import COUNTERS, counts_of, trace_lanes
from tracer.memory import need_of, rays_that_fit
from tracer.phases import Phases
from tracer.pixel_records import components_of, taken_apart
from tracer.pixels import BandLanes, Lanes
from tracer.scene import Scene
from tracer.settings import Settings, picture_canvas, picture_rectangle
from tracer.tiles import Band, Rectangle, bands

Progress = Callable[[int, int, int], None]
"""(finished pixels, all pixels, rays traced by this run), called at first and after every band."""

Found = tuple[dict[str, np.ndarray], dict[str, Any]]
"""What a launch finds: layers, each of all its pixels, components last; counts."""


class PassInterrupted(KeyboardInterrupt):
    """Ctrl-C during a pass; `film` holds the bands that were finished."""

    def __init__(self, film: Film) -> None:
        super().__init__("interrupted")
        self.film = film


class Passes:
    """Traces rectangles of one picture; `n`: each pixel is the mean of at most n x n sub-rays."""

    def __init__(
        self,
        scene: Scene,
        settings: Settings,
        backend: Backend,
        progress: Progress | None,
        work: WorkFile | None,
    ) -> None:
        self.scene, self.settings, self.backend = scene, settings, backend
        self.canvas = picture_canvas(scene, settings)
        self.rectangle = picture_rectangle(settings.crop, self.canvas)
        self.n = settings.grid(scene)
        self.layers = [name for name in settings.aovs if name in layers_of(scene)]
        self.phases = Phases()
        self.progress = progress or (lambda done, total, rays: None)
        self._work = work
        self._components = components_of(self.layers, len(scene.lights))
        self._counted_shapes = len(scene.shapes) if settings.count_hits else 0
        x0, y0, x1, y1 = self.rectangle
        # with fewer rays no frame asks bundles
        self._animated = settings.animated and enough_for_bundles((x1 - x0) * (y1 - y0) * self.n**2)
        with self.phases.phase("build"):
            self._device = compile_scene(scene, backend, settings.animated)
            self.device_canvas = DeviceCanvas.of(backend, self.canvas)

    def over(self, rectangle: Rectangle) -> Film:
        """The film of a rectangle, all sub-rays of all pixels traced. Raises `PassInterrupted`."""
        film = self.empty_film(rectangle)
        rays = self.rays_at_once(rectangle, self.n**2)

        def trace(band: Band) -> Found:
            lanes = BandLanes.of(self.backend, band, self.canvas.width, self.n)
            return self.launch(lanes, self.device_canvas, self.n)

        def cut(rest: Rectangle) -> Iterable[Band]:
            return bands(rest, self.n**2, rays)

        self.run(film, list(rectangle), cut, trace, lambda done, rays: self.progress(done, film.pixels, rays))
        return film

    def run(
        self,
        film: Film,
        name: list[Any],
        cut: Callable[[Rectangle], Iterable[Band]],
        trace: Callable[[Band], Found],
        report: Callable[[int, int], None],
    ) -> int:
        """Fills a film, band by band; returns how many rays that took in this run. Raises `PassInterrupted`.

        `name`: of the pass in the work file, JSON; `cut`: what remains into bands; `report`: is told of
        finished pixels and of the rays of this run.
        """
        kept = KeptBands(self._work, name, film, self._identity)
        with self.phases.phase("trace"):
            remaining = kept.restore()
            self.phases.seconds["trace"] += kept.seconds
            earlier = number_of_rays(film.counts)
            try:
                report(film.finished, 0)
                for band in (band for rest in remaining for band in cut(rest)):
                    _take(film, band, *trace(band))
                    self.phases.count_kernels()
                    kept.finished(band)
                    report(film.finished, number_of_rays(film.counts) - earlier)
            except KeyboardInterrupt:
                kept.finish()
                raise PassInterrupted(film) from None
        return number_of_rays(film.counts) - earlier

    def launch(self, lanes: Lanes, canvas: DeviceCanvas, n: int) -> Found:
        """The layers of the pixels of `lanes`, and what was counted; primary rays of each pixel."""
        first = first_hits(self._device, self.canvas, canvas, lanes, n, self._animated)
        found = trace_lanes(self._device, canvas, lanes, first, tuple(self.layers), self._counted_shapes)
        counts = counts_of(found) | {"primary": n * n}
        arrays = {key: values.numpy() for key, values in found.items()}
        return taken_apart(arrays, self._components, self.backend.precision == "single"), counts

    def empty_film(self, rectangle: Rectangle) -> Film:
        """A film of which nothing is traced."""
        counts: dict[str, Any] = dict.fromkeys(("primary", *COUNTERS), 0)
        if self._counted_shapes:
            counts["hits"] = [0] * self._counted_shapes
        return Film(rectangle, self.backend.dtype, counts)

    def rays_at_once(self, rectangle: Rectangle, sub_rays: int) -> int:
        """As many as were asked for, or fewer, if memory is short."""
        x0, y0, x1, y1 = rectangle
        real, triangles = np.dtype(self.backend.dtype).itemsize, self._device.triangles is not None
        pixels, adaptive = (x1 - x0) * (y1 - y0), self.settings.adaptive
        need = need_of(self.scene, self.layers, pixels, real, triangles, adaptive)
        return rays_that_fit(need, sub_rays, self.settings.memory, self.settings.rays_per_band)

    def _identity(self) -> dict[str, Any]:
        """What a work file must agree in."""
        return identity_of(self.scene, self.settings, self.canvas, self.rectangle, self.backend, self.layers)


def _take(film: Film, band: Band, layers: dict[str, np.ndarray], counts: dict[str, Any]) -> None:
    """Adds a finished band, whose layers must not outlive that: the next band needs the memory."""
    film.take(band, layers)
    pixels = band.width * band.height
    film.counts = together(film.counts, counts | {"primary": counts["primary"] * pixels})


def layers_of(scene: Scene) -> list[str]:
    """The layers that a picture of the scene can have besides the depth; no visibility without lights."""
    return [name for name in NAMES if name != VISIBILITY or scene.lights]
