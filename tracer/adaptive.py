"""Adaptive supersampling: one ray a pixel first, then all n x n of the pixels that differ from a neighbor.

The first ray is one of the grid's own, that in the middle (the last one before it where n is even). The
pixels to be refined are gathered into one list, in the order of lanes, and traced in launches as large as
those of whole bands: pixels from everywhere fill a launch together. Both passes are the same kernel, in which
pixels come from a list. A refined pixel is traced anew with all its sub-rays in their order, so it has the
bytes that it has in the full grid.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from tracer.canvas import DeviceCanvas
from tracer.contrast import MARGIN, differing_pixels
from tracer.film.counts import together
from tracer.film.film import Film
from tracer.passes import Found, Passes, PassInterrupted
from tracer.pixels import ListedLanes
from tracer.tiles import FEWEST_PIXELS, Band, Rectangle, bands


class Adaptive:
    """Traces rectangles of a picture adaptively; the bytes of a pixel do not depend on the rectangle."""

    def __init__(self, passes: Passes) -> None:
        self._passes, self._threshold = passes, passes.settings.threshold or 0.0
        canvas, n, real = passes.canvas, passes.n, passes.backend.dtype
        middle = (real((n - 1) // 2) + real(canvas.offset)) / real(n)  # rounded as in the kernel
        self._middle_ray = DeviceCanvas.of(passes.backend, replace(canvas, offset=float(middle)))

    def over(self, rectangle: Rectangle) -> Film:
        """The film of a rectangle; its counts are those of both passes, and of pixels around it that decided
        along with it. Raises `PassInterrupted`."""
        passes = self._passes
        x0, y0, x1, y1 = rectangle
        wide = (
            max(0, x0 - MARGIN),
            max(0, y0 - MARGIN),
            min(passes.canvas.width, x1 + MARGIN),
            min(passes.canvas.height, y1 + MARGIN),
        )
        at_once = passes.rays_at_once(wide, 1), passes.rays_at_once(wide, passes.n**2)
        first = passes.empty_film(wide)
        steps = first.pixels + (x1 - x0) * (y1 - y0)
        try:
            rays = self._first_pass(first, at_once[0], steps)
        except PassInterrupted as interrupted:
            raise PassInterrupted(_part_of(interrupted.film, rectangle)) from None
        with passes.phases.phase("trace"):
            linear = passes.scene.color_space == "linear"
            columns, rows = differing_pixels(first, rectangle, self._threshold, linear)
        film = _part_of(first, rectangle)
        refined = passes.empty_film((0, 0, 1, len(columns)))
        try:
            self._refine(refined, columns, rows, at_once[1], (rectangle, steps, rays))
        except PassInterrupted:
            _put(film, refined, columns, rows)
            raise PassInterrupted(film) from None
        _put(film, refined, columns, rows)
        return film

    def _first_pass(self, film: Film, at_once: int, steps: int) -> int:
        passes = self._passes

        def trace(band: Band) -> Found:
            lanes = ListedLanes.of_band(passes.backend, band, passes.canvas.width, 1)
            return passes.launch(lanes, self._middle_ray, 1)

        return passes.run(
            film,
            ["first", *film.rectangle],
            lambda rest: bands(rest, 1, at_once),
            trace,
            lambda done, rays: passes.progress(done, steps, rays),
        )

    def _refine(
        self,
        film: Film,
        columns: np.ndarray,
        rows: np.ndarray,
        at_once: int,
        before: tuple[Rectangle, int, int],
    ) -> None:
        """Fills a film that is one pixel wide, with a row for each pixel of the list."""
        passes, n = self._passes, self._passes.n
        rectangle, steps, rays_before = before
        height = max(FEWEST_PIXELS, at_once // n**2)

        def cut(rest: Rectangle) -> Iterator[Band]:
            x0, y0, x1, y1 = rest
            return (Band(x0, top, x1, min(top + height, y1)) for top in range(y0, y1, height))

        def trace(band: Band) -> Found:
            part = slice(band.y0, band.y1)
            lanes = ListedLanes.of_pixels(passes.backend, columns[part], rows[part], passes.canvas.width, n)
            layers, counts = passes.launch(lanes, passes.device_canvas, n)
            return {name: v.reshape(lanes.room, -1)[: band.height] for name, v in layers.items()}, counts

        passes.run(
            film,
            ["refined", *rectangle],
            cut,
            trace,
            lambda done, rays: passes.progress(steps - len(columns) + done, steps, rays_before + rays),
        )


def _part_of(film: Film, rectangle: Rectangle) -> Film:
    """A film of a part of what another one covers; the same counts."""
    if film.rectangle == rectangle:
        return film
    x0, y0, x1, y1 = rectangle
    left, above = film.rectangle[:2]
    part = slice(y0 - above, y1 - above), slice(x0 - left, x1 - left)
    result = film.blank_copy(rectangle)
    result.arrays = {name: np.ascontiguousarray(array[part]) for name, array in film.arrays.items()}
    return result


def _put(film: Film, refined: Film, columns: np.ndarray, rows: np.ndarray) -> None:
    """Puts the finished pixels of a list into a film, and adds the counts."""
    done = slice(refined.finished)
    x0, y0 = film.rectangle[:2]
    for name, array in refined.arrays.items():
        film.arrays[name][rows[done] - y0, columns[done] - x0] = array[done, 0]
    film.counts = together(film.counts, refined.counts) | {"refined_pixels": refined.finished}
