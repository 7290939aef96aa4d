"""Which pixels of a picture rounding decides, as the integrator on Mitsuba's hits shows: the tracer is never
asked whether its own errors count.

A pixel is in doubt where its color moves with what must not matter: the canvas, by some roundings; the place
at which secondary rays start; the small value at borders of texture cells, which the model makes depend on
the precision; how far the disks reach that stand for planes.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import tracer
from reference import whitted
from reference.tolerances import EPSILON, TOLERANCES
from reference.whitted_world import START

Array = np.ndarray

STEPS = (4, 16, 168, TOLERANCES["canvas moves"].value)
"""Moves of the canvas in roundings of S. 168 is 1e-5 S: so far borders of texture cells are shifted in single
precision, and so far from the surface they leave the reference starts secondary rays."""

STARTS = (0.25, 0.5, 2.0, 4.0, TOLERANCES["start moves"].value)
"""Other starts of secondary rays, as factors."""

CELL_SHIFT = 1e-6
"""The model's small value at borders of texture cells in double precision."""

REACH = 1e3
"""Factor of the size of disks that stand for planes."""


def doubt(scene: tracer.Scene, extent: float, supersample: int | None = None) -> Array:
    """(h, w) by how much the color of each pixel moves, infinite where it is blank in some variant and not in
    another; `extent`: S."""
    maker = whitted.Whitted(scene, supersample)
    still = maker.still()
    change = np.zeros(still.depth.shape)
    for other in _variants(scene, maker, extent, supersample):
        apart = np.abs(other.color - still.color).max(axis=2)
        flips = (other.depth < 0) != (still.depth < 0)
        change = np.maximum(change, np.where(flips, np.inf, apart))
    return change


def _variants(
    scene: tracer.Scene, maker: whitted.Whitted, extent: float, supersample: int | None
) -> Iterator[whitted.Picture]:
    for steps in STEPS:
        for direction in np.vstack([np.eye(3), -np.eye(3)]):
            yield maker.varied(shift=steps * EPSILON["single"] * extent * direction).still()
    for factor in STARTS:
        yield maker.varied(start=factor * START).still()
    yield maker.varied(cell_shift=CELL_SHIFT).still()
    yield whitted.Whitted(scene, supersample, reach=REACH).still()
