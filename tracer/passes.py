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
from tracer.first_hits import first_hits
from tracer.kept_bands import KeptBands, identity_of
from tracer.launch import COUNTERS, counts_of, trace_band
from tracer.memory import need_of, rays_that_fit
from tracer.phases import Phases
from tracer.pixels import BandPlace
from tracer.scene import Scene
from tracer.settings import Settings, picture_canvas, picture_rectangle
from tracer.tiles import Band, Rectangle, bands

Progress = Callable[[int, int, int], None]
"""(finished pixels, all pixels, rays traced by this run), called at first and after every band."""


class PassInterrupted(KeyboardInterrupt):
    """Ctrl-C during a pass; `film` holds the bands that were finished."""

    def __init__(self, film: Film) -> None:
        super().__init__("interrupted")
        self.film = film


class Passes:
    """Traces rectangles of one picture; `n`: each pixel is the mean of n x n sub-rays."""

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
        self.n = settings.supersample or scene.camera.supersample
        self.layers = [name for name in settings.aovs if name in layers_of(scene)]
        self.phases = Phases()
        self._progress, self._work = progress, work
        self._counted_shapes = len(scene.shapes) if settings.count_hits else 0
        with self.phases.phase("build"):
            self._device = compile_scene(scene, backend)
            self._device_canvas = DeviceCanvas.of(backend, self.canvas)

    def over(self, rectangle: Rectangle) -> Film:
        """The film of a rectangle. Raises `PassInterrupted`."""
        film = self._empty_film(rectangle)
        with self.phases.phase("trace"):
            self._run(film)
        return film

    def _empty_film(self, rectangle: Rectangle) -> Film:
        counts: dict[str, Any] = dict.fromkeys(("primary", *COUNTERS), 0)
        if self._counted_shapes:
            counts["hits"] = [0] * self._counted_shapes
        return Film(rectangle, self.backend.dtype, counts)

    def _run(self, film: Film) -> None:
        with KeptBands(self._work, film, self._identity) as kept:
            remaining = kept.restore()
            self.phases.seconds["trace"] += kept.seconds
            earlier = number_of_rays(film.counts)
            try:
                self._report(film, earlier)
                for band in self._cut(remaining, film.rectangle):
                    self._trace_band(film, band)
                    self.phases.count_kernels()
                    kept.finished(band)
                    self._report(film, earlier)
            except KeyboardInterrupt:
                kept.finish()
                raise PassInterrupted(film) from None

    def _cut(self, rectangles: Iterable[Rectangle], whole: Rectangle) -> Iterable[Band]:
        """Bands as large as was asked for, or smaller, if memory is short."""
        x0, y0, x1, y1 = whole
        real, triangles = np.dtype(self.backend.dtype).itemsize, self._device.triangles is not None
        need = need_of(self.scene, self.layers, (x1 - x0) * (y1 - y0), real, triangles)
        sub_rays = self.n**2
        rays = rays_that_fit(need, sub_rays, self.settings.memory, self.settings.rays_per_band)
        return (band for rectangle in rectangles for band in bands(rectangle, sub_rays, rays))

    def _report(self, film: Film, earlier: int) -> None:
        if self._progress is not None:
            x0, y0, x1, y1 = film.rectangle
            self._progress(film.finished, (x1 - x0) * (y1 - y0), number_of_rays(film.counts) - earlier)

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
        first = first_hits(self._device, self.canvas, self._device_canvas, place, size, self.n)
        layers, shapes = tuple(self.layers), self._counted_shapes
        found = trace_band(self._device, self._device_canvas, place, size, first, layers, shapes)
        counts = counts_of(found) | {"primary": band.width * band.height * self.n**2}
        film.take(band, {name: values.numpy() for name, values in found.items()})
        film.counts = together(film.counts, counts)


def layers_of(scene: Scene) -> list[str]:
    """The layers that a picture of the scene can have besides the depth; no visibility without lights."""
    return [name for name in NAMES if name != VISIBILITY or scene.lights]
