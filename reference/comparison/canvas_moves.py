"""Which pixels change when the canvas moves by rounding: there something small decides the color."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import tracer
from reference.tolerances import EPSILON

Array = np.ndarray

STEPS = (4, 16, 168, 504)
"""Moves of the canvas in roundings of S. The third is 1e-5 S: so far borders of texture cells are shifted in
single precision, and so far from the surface they leave the integrator on Mitsuba's hits starts rays. The
last takes surfaces to the border of a cell that are oblique to all axes."""


def moved(scene: tracer.Scene, shift: Array) -> tracer.Scene:
    """The scene with its canvas and eye elsewhere."""
    camera = scene.camera
    keys = ("origin", "target") if camera.is_look_at else ("position",)
    update = {key: tuple((np.array(getattr(camera, key)) + shift).tolist()) for key in keys}
    return scene.model_copy(update={"camera": camera.model_copy(update=update)})


def canvas_changes(scene: tracer.Scene, extent: float, supersample: int | None = None) -> Array:
    """(h, w) by how much the color of each pixel, in double precision, moves with the canvas; `extent`: S."""

    def color(canvas: tracer.Scene) -> Array:
        return np.asarray(tracer.render(canvas, "double", supersample=supersample).color)

    return largest_change(color, color(scene), scene, extent, STEPS)


def largest_change(
    color: Callable[[tracer.Scene], Array],
    still: Array,
    scene: tracer.Scene,
    extent: float,
    steps: tuple[int, ...],
) -> Array:
    """(h, w) the largest difference of colors from `still` (h, w, 3), over moves of the canvas along all
    axes by so many roundings of `extent`."""
    change = np.zeros(still.shape[:2])
    for step in steps:
        for direction in np.vstack([np.eye(3), -np.eye(3)]):
            other = color(moved(scene, step * EPSILON["single"] * extent * direction))
            change = np.maximum(change, np.abs(other - still).max(axis=2))
    return change
