"""Adaptive supersampling: one ray a pixel first, then all n x n of the pixels that differ from a neighbor.

The first ray is one of the grid's own, that in the middle (the last one before it where n is even). The
pixels to be refined are gathered into one list, in the order of lanes, and traced in launches as large as
those of whole bands: pixels from everywhere fill a launch together. Both passes are the same kernel, in which
pixels come from a list. A refined pixel is traced anew with all its sub-rays in their order, so it has the
bytes that it has in the full grid.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

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
        passes, progress = self._passes, self._passes.progress
        x0, y0, x1, y1 = rectangle
        first = passes.empty_film(
            (
                max(0, x0 - MARGIN),
                max(0, y0 - MARGIN),
                min(passes.canvas.width, x1 + MARGIN),
                min(passes.canvas.height, y1 + MARGIN),
            )
        )
        at_once, at_once_refined = (passes.rays_at_once(first.rectangle, rays) for rays in (1, passes.n**2))
        steps = first.pixels + (x1 - x0) * (y1 - y0)
        try:
            before = self._first_pass(first, at_once, lambda done, rays: progress(done, steps, rays))
        except PassInterrupted:
            raise PassInterrupted(_part_of(first, rectangle)) from None
        with passes.phases.phase("trace"):
            linear = passes.scene.color_space == "linear"
            columns, rows = differing_pixels(first, rectangle, self._threshold, linear)
        film, refined = _part_of(first, rectangle), passes.empty_film((0, 0, 1, len(columns)))
        settled = steps - len(columns)

        def report(done: int, rays: int) -> None:
            progress(settled + done, steps, before + rays)

        try:
            self._refine(refined, ["refined", *rectangle], (columns, rows), at_once_refined, report)
        except PassInterrupted:
            _put(film, refined, columns, rows)
            raise PassInterrupted(film) from None
        _put(film, refined, columns, rows)
        return film

    def _first_pass(self, film: Film, at_once: int, report: Callable[[int, int], None]) -> int:
        """One ray a pixel; returns the rays of this run."""
        passes = self._passes

        def cut(rest: Rectangle) -> Iterator[Band]:
            return bands(rest, 1, at_once)

        def trace(band: Band) -> Found:
            lanes = ListedLanes.of_band(passes.backend, band, passes.canvas.width, 1)
            return passes.launch(lanes, self._middle_ray, 1)

        return passes.run(film, ["first", *film.rectangle], cut, trace, report)

    def _refine(
        self,
        film: Film,
        name: list[Any],
        pixels: tuple[np.ndarray, np.ndarray],
        at_once: int,
        report: Callable[[int, int], None],
    ) -> None:
        """All sub-rays of the pixels of a list, columns and rows (k,): a film one pixel wide and k high."""
        passes, n = self._passes, self._passes.n
        columns, rows = pixels
        height = max(FEWEST_PIXELS, at_once // n**2)

        def cut(rest: Rectangle) -> Iterator[Band]:
            x0, y0, x1, y1 = rest
            return (Band(x0, top, x1, min(top + height, y1)) for top in range(y0, y1, height))

        def trace(band: Band) -> Found:
            part = slice(band.y0, band.y1)
            lanes = ListedLanes.of_pixels(passes.backend, columns[part], rows[part], passes.canvas.width, n)
            layers, counts = passes.launch(lanes, passes.device_canvas, n)
            return {
                layer: values.reshape(lanes.room, -1)[: band.height] for layer, values in layers.items()
            }, counts

        passes.run(film, name, cut, trace, report)


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
