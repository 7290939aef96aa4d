"""The term of the camera: the rays through pixel centers."""

from __future__ import annotations

import numpy as np

import tracer
from reference.comparison.case import Case
from reference.comparison.judge import SINGLE, Numbers, bounds, judge_numbers
from reference.comparison.records import Outcome, Term
from reference.comparison.renders import grid, pixel_centers, small_mitsuba
from tracer.backends import exact_arithmetic, find_backend
from tracer.canvas import Canvas, DeviceCanvas
from tracer.whitted import PixelGrid, primary_ray

Array = np.ndarray


def our_rays(case: Case, scene: tracer.Scene, pixel: Array) -> tuple[Array, Array]:
    """Origins and directions (n, 3) of the renderer's primary rays through pixels."""
    types = find_backend(case.backend, case.precision)
    column, row = (types.UInt32(np.ascontiguousarray(c, np.uint32)) for c in pixel.T)
    with exact_arithmetic():
        canvas = DeviceCanvas.of(types, Canvas.of(scene.camera, scene.literal))
        pixels = PixelGrid(column, row, types.UInt32(0), types.opaque_id(1), types.Bool(True))
        o, d = primary_ray(types, canvas, pixels, types.UInt32(0))
        return o.numpy().T.astype(np.float64), d.numpy().T.astype(np.float64)


def compare_camera(case: Case) -> Outcome:
    """Origins in eps S, S the largest |coordinate| of canvas and eye, and directions in eps: the larger of
    the two errors of each ray."""
    scene = case.bench.small
    pixel, rays = grid(scene), pixel_centers(case, scene)
    o, d = rays.o, rays.d
    theirs, ours = small_mitsuba(case).camera_rays(), our_rays(case, scene, pixel)
    eye = o - scene.camera.eye_distance * d
    extent = max(float(np.abs(o).max()), float(np.abs(eye).max()))

    def error(a: tuple[Array, Array], b: tuple[Array, Array], epsilon: float) -> Array:
        place, way = (np.abs(x - y).max(axis=1) for x, y in zip(a, b, strict=True))
        return np.asarray(np.maximum(place / extent, way) / epsilon)

    numbers = Numbers(
        rays=rays,
        index=np.arange(len(rays)),
        difference=error(ours, theirs, SINGLE),
        ours=error(ours, (o, d), case.epsilon),
        mitsuba=error(theirs, (o, d), SINGLE),
        unit="eps S and eps",
        answers=lambda i: (
            f"{ours[0][i]} -> {ours[1][i]}",
            f"{theirs[0][i]} -> {theirs[1][i]}",
            f"{o[i]} -> {d[i]}",
        ),
    )
    return judge_numbers(case, "camera rays", numbers, bounds(case, "camera", "mitsuba camera"))


def terms() -> list[Term]:
    """The one term."""
    return [
        Term("camera rays", "origin and direction of the ray of each pixel", lambda _: True, compare_camera)
    ]
