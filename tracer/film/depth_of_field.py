"""Depth of field: a filter over the finished picture that mixes pixels of similar distance (document, section
8).

For a pixel of depth x the blur measure is f = max(x/focus, focus/x). Draws go to pixels less than f columns
and rows away whose distance from the eye differs by less than `depth_range`; the result is the mean of their
first-pass colors. All arithmetic is in double precision on the depth as stored.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np

from tracer.backends import Backend, find_backend
from tracer.camera import DepthOfField
from tracer.canvas import Canvas
from tracer.film.first_pass import FirstPass, eye_distance
from tracer.random import DEPTH_OF_FIELD_STREAM, below, philox
from tracer.tiles import Rectangle

ATTEMPTS = 64
"""Misses after which a draw stops guessing and walks through the pixels it may take."""

LARGE_WINDOW = 4096
"""Pixels of a window above which a draw guesses among the pixels of similar distance, if those are fewer."""

LARGEST_REACH = 1 << 20

PIXELS_PER_LAUNCH = 1 << 18
"""Few enough for an answer to Ctrl-C."""


def blur_reach(depth: np.ndarray, settings: DepthOfField, canvas: Canvas) -> int:
    """How many columns and rows away the filter reads at most, for pixels of that depth (h, w)."""
    x = depth[depth > 0].astype(np.float64)
    if not len(x):
        return 0
    measure = max(x.max() / settings.focus, settings.focus / x.min())
    return int(min(np.ceil(measure * canvas.scale) - 1, LARGEST_REACH))


def rectangle_needed(
    target: Rectangle, depth: np.ndarray, settings: DepthOfField, canvas: Canvas
) -> Rectangle:
    """The pixels that the filter reads for `target`, whose first pass has that depth (h, w).

    Windows that are large are drawn from by distance, for which the whole picture counts.
    """
    reach = blur_reach(depth, settings, canvas)
    if (2 * reach + 1) ** 2 > LARGE_WINDOW:
        return (0, 0, canvas.width, canvas.height)
    x0, y0, x1, y1 = target
    return (
        max(0, x0 - reach),
        max(0, y0 - reach),
        min(canvas.width, x1 + reach),
        min(canvas.height, y1 + reach),
    )


def depth_of_field(
    backend: Backend,
    color: np.ndarray,
    depth: np.ndarray,
    source: Rectangle,
    target: Rectangle,
    settings: DepthOfField,
    canvas: Canvas,
) -> np.ndarray:
    """The filtered colors (h, w, 3) of the rectangle `target` from a first pass over the rectangle `source`.

    `color` (h', w', 3), `depth` (h', w'): the first pass, at least over `rectangle_needed`.
    """
    double = find_backend(backend.name, "double")
    large = (2 * blur_reach(depth, settings, canvas) + 1) ** 2 > LARGE_WINDOW
    first = FirstPass.of(double, color, depth, source, canvas, large)
    x0, y0, x1, y1 = target
    width, height = x1 - x0, y1 - y0
    result = np.empty((height, width, 3), color.dtype)
    rows = max(1, PIXELS_PER_LAUNCH // width)
    for top in range(0, height, rows):
        lines = min(rows, height - top)
        lane = dr.arange(double.UInt32, width * lines)
        row = lane // double.opaque_id(width)
        column = lane - row * double.opaque_id(width) + double.opaque_id(x0)
        mixed = _filter(double, first, column, row + double.opaque_id(y0 + top), settings, canvas)
        dr.eval(mixed)
        channels = [channel.numpy() for channel in mixed]  # together they would cost a kernel for each size
        result[top : top + lines] = np.stack(channels, axis=-1).reshape(lines, width, 3)
    return result


@dr.syntax
def _filter(
    backend: Backend, first: FirstPass, column: Any, row: Any, settings: DepthOfField, canvas: Canvas
) -> Any:
    # ---- Window and admissible range of every pixel ----
    width = dr.width(column)
    index = first.index(backend, column, row)
    x = dr.gather(backend.Float, first.depth, index)
    own = dr.gather(backend.Vector3, first.color, index)
    sharp = x > 0
    focus = backend.opaque(settings.focus)
    measure = dr.select(sharp, dr.maximum(x / focus, focus / x), 1)
    steps = dr.ceil(measure * backend.opaque(canvas.scale)) - 1
    reach = backend.UInt32(dr.minimum(dr.maximum(steps, 0), LARGEST_REACH))
    low_column, columns = _window(backend, column, reach, first.x0, first.x1)
    low_row, rows = _window(backend, row, reach, first.y0, first.y1)
    eye = eye_distance(backend, canvas, column, row) + x
    depth_range = backend.opaque(
        0.1 * settings.focus if settings.depth_range is None else settings.depth_range
    )
    pixel = row * backend.opaque_id(canvas.width) + column
    key = (backend.opaque_id(settings.seed & 0xFFFFFFFF), backend.UInt32(DEPTH_OF_FIELD_STREAM))
    samples = backend.opaque_id(settings.samples)

    # ---- Where to draw from: the window, or the pixels of similar distance if those are fewer ----
    size = columns * rows
    begin, count = first.similar(backend, canvas, eye, depth_range)
    by_distance = (size > LARGE_WINDOW) & (count < size)
    size = dr.select(by_distance, count, size)

    # ---- Draws ----
    # Every turn looks at one pixel of that set. A draw guesses; after 64 misses the set is walked, once to
    # count the admissible pixels and then up to the one that the draw names. Sums are of differences to the
    # own color: where all colors are the same the result is exactly that color.
    total = dr.zeros(backend.Vector3, width)
    drawn = dr.zeros(backend.UInt32, width)
    attempt = dr.zeros(backend.UInt32, width)
    admissible = dr.zeros(backend.UInt32, width)  # 0: not counted yet
    passed = dr.zeros(backend.UInt32, width)  # admissible pixels that the walk has left behind
    walked = dr.zeros(backend.UInt32, width)  # pixels that the walk has left behind
    walk_column, walk_row = low_column + 0, low_row + 0
    one, none = backend.UInt32(1), backend.UInt32(0)
    active = sharp & (reach > 0)
    while dr.hint(active, label="depth of field", exclude=[backend, first, canvas, settings]):
        words = philox(key, (pixel, drawn, attempt, backend.UInt32(0)))
        guesses = attempt < ATTEMPTS
        at_column = dr.select(guesses, low_column + below(words[0], columns), walk_column)
        at_row = dr.select(guesses, low_row + below(words[1], rows), walk_row)
        rank = begin + dr.select(guesses, below(words[0], size), walked)
        place = dr.gather(backend.UInt32, first.pixels, rank, by_distance & active)
        at_column = dr.select(by_distance, place & 0xFFFF, at_column)
        at_row = dr.select(by_distance, place >> 16, at_row)
        in_window = (at_column - low_column < columns) & (at_row - low_row < rows)
        fits = in_window & first.admissible(
            backend, canvas, at_column, at_row, eye, depth_range, in_window & active
        )
        chosen = (admissible > 0) & (passed == below(words[0], admissible))
        taken = active & fits & (guesses | chosen)
        found = dr.gather(backend.Vector3, first.color, first.index(backend, at_column, at_row), taken)
        total += dr.select(taken, found - own, 0)
        drawn += dr.select(taken, one, none)

        # ---- The next pixel of the walk; back to its start when it ends ----
        passed += dr.select(fits & ~guesses, one, none)
        ends = walked + 1 == size
        admissible = dr.select(~guesses & ends & (admissible == 0), passed, admissible)
        restarts = guesses | taken | ends
        line_ends = walk_column + 1 == low_column + columns
        passed = dr.select(restarts, none, passed)
        walked = dr.select(restarts, none, walked + 1)
        walk_row = dr.select(restarts, low_row, dr.select(line_ends, walk_row + 1, walk_row))
        walk_column = dr.select(restarts | line_ends, low_column, walk_column + 1)
        attempt = dr.select(taken, none, dr.select(guesses, attempt + 1, attempt))
        active &= drawn < samples
    return own + total / backend.Float(samples)


def _window(backend: Backend, center: Any, reach: Any, low: int, high: int) -> tuple[Any, Any]:
    """First coordinate and length of the window [center - reach, center + reach] within low .. high - 1."""
    low_id, last = backend.opaque_id(low), backend.opaque_id(high - 1)
    begin = dr.select(center - low_id > reach, center - reach, low_id)
    end = dr.select(last - center > reach, center + reach, last)
    return begin, end - begin + 1
