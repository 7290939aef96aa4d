"""How far two pictures are apart: display values and CIEDE2000 (document, section 9)."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracer.color import BAND, colour_science
from tracer.errors import UsageError
from tracer.film.atomic import check_writable
from tracer.film.png import write_png


@dataclass(frozen=True)
class Comparison:
    """Differences of display-referred values; those of color are CIEDE2000, where about 1 is just visible."""

    maximum: float  # largest |a - b| of any channel
    rms: float  # root of the mean square over all channels
    delta_e_mean: float
    delta_e_max: float
    differing: int  # pixels with a difference above the tolerance
    pixels: int
    position: tuple[int, int] | None  # column and row of the maximum, the first in reading order; None: equal


def compare_pictures(a: NDArray, b: NDArray, tolerance: float = 0.0) -> Comparison:
    """Compares two display-referred pictures (h, w, 3); UsageError where the sizes differ.

    A NaN that only one of them has, or an infinity, counts as an infinite difference. CIEDE2000 sees what a
    screen shows: values limited to 0..1, NaN as 0.
    """
    _refuse_other_sizes(a, b)
    first, second = a.reshape(-1, 3), b.reshape(-1, 3)
    worst, where, squares, differing = 0.0, -1, 0.0, 0
    color_sum, color_max = 0.0, 0.0
    for start in range(0, len(first), BAND // 3):
        p, q = first[start : start + BAND // 3], second[start : start + BAND // 3]
        apart = _distance(p, q)
        squares += float(np.sum(apart * apart))
        largest = apart.max(axis=1)
        differing += int(np.count_nonzero(largest > tolerance))
        peak = int(largest.argmax())
        if largest[peak] > worst:
            worst, where = float(largest[peak]), start + peak
        unequal = largest > 0
        if unequal.any():
            color = _delta_e(p[unequal], q[unequal])
            color_sum, color_max = color_sum + float(color.sum()), max(color_max, float(color.max()))
    width, pixels = a.shape[1], len(first)
    return Comparison(
        maximum=worst,
        rms=(squares / (3 * pixels)) ** 0.5,
        delta_e_mean=color_sum / pixels,
        delta_e_max=color_max,
        differing=differing,
        pixels=pixels,
        position=(where % width, where // width) if where >= 0 else None,
    )


def write_difference(path: str | os.PathLike[str], a: NDArray, b: NDArray, gain: float | None = None) -> None:
    """Writes |a - b| times `gain` as a PNG; by default the largest finite difference becomes white.

    Raises UsageError where the sizes differ, OutputError where the file cannot be written.
    """
    check_writable(path, (".png",))
    _refuse_other_sizes(a, b)
    apart = _distance(a, b)
    if gain is None:
        largest = float(apart.max(where=np.isfinite(apart), initial=0.0))
        gain = 1 / largest if largest > 0 else 1.0
    write_png(path, apart * gain)


def _distance(p: NDArray, q: NDArray) -> NDArray[np.float64]:
    """|p - q|; 0 where both are the same infinity or both NaN, infinite where one alone is NaN."""
    with np.errstate(invalid="ignore"):
        apart = np.abs(np.subtract(p, q, dtype=np.float64))
    broken = np.isnan(apart)
    if broken.any():
        same = (p == q) | (np.isnan(p) & np.isnan(q))
        apart[broken] = np.where(same[broken], 0.0, np.inf)
    return apart


def _delta_e(p: NDArray, q: NDArray) -> NDArray[np.float64]:
    """CIEDE2000 of display-referred sRGB colors (n, 3), seen under D65."""
    colour = colour_science()
    lab = [colour.XYZ_to_Lab(colour.sRGB_to_XYZ(np.clip(np.nan_to_num(c), 0, 1))) for c in (p, q)]
    return colour.difference.delta_E_CIE2000(*lab)


def _refuse_other_sizes(a: NDArray, b: NDArray) -> None:
    if a.shape != b.shape:
        sizes = " and ".join(f"{picture.shape[1]} x {picture.shape[0]}" for picture in (a, b))
        raise UsageError(f"the pictures have different sizes: {sizes} pixels; allowed: equal sizes")
