"""The term of the camera: the rays through pixel centers."""

from __future__ import annotations

import numpy as np

import tracer
from reference import extended, mitsuba_scene
from reference.comparison.case import PIXELS, Case, small_picture
from reference.comparison.judge import SINGLE, Numbers, bounds, judge_numbers
from reference.comparison.rays import RaySet
from reference.comparison.records import Outcome, Term
from reference.comparison.renders import grid
from tracer.backends import exact_arithmetic, find_backend
from tracer.canvas import Canvas, DeviceCanvas
from tracer.pixels import PixelGrid, primary_ray

Array = np.ndarray


def our_rays(case: Case, scene: tracer.Scene, pixel: Array, sub_ray: Array) -> tuple[Array, Array]:
    """Origins and directions (n, 3) of the renderer's primary rays, one sub-ray of each pixel."""
    types = find_backend(case.backend, case.precision)
    column, row, number = (types.UInt32(np.ascontiguousarray(c, np.uint32)) for c in (*pixel.T, sub_ray))
    with exact_arithmetic():
        canvas = DeviceCanvas.of(types, Canvas.of(scene.camera, scene.literal))
        n = types.opaque_id(scene.camera.supersample)
        pixels = PixelGrid(
            types.UInt32(0), types.UInt32(1), column, row, types.UInt32(0), n, types.Bool(True)
        )
        o, d = primary_ray(types, canvas, pixels, number)
        return o.numpy().T.astype(np.float64), d.numpy().T.astype(np.float64)


def true_rays(case: Case, scene: tracer.Scene, pixel: Array, sub_ray: Array) -> RaySet:
    """The same from the numbers of the scene file, in extended precision rounded once to doubles."""
    n, offset = scene.camera.supersample, extended.pixel_offset(scene.camera, scene.literal)
    a, b = sub_ray % n, sub_ray // n
    o, d = extended.camera_rays(scene.camera, pixel[:, 0] + (a + offset) / n, pixel[:, 1] + (b + offset) / n)
    named = scene.camera.resolution == case.scene.camera.resolution and n == 1
    return RaySet(extended.double(o), extended.double(d), pixel if named else np.full_like(pixel, -1))


def compare_camera(case: Case) -> Outcome:
    """Of every pixel one of its n x n sub-rays: origins in eps S, S the largest |coordinate| of canvas and
    eye, and directions in eps: the larger of the two errors of each ray."""
    n = case.scene.camera.supersample
    scene = small_picture(case.bench.scene, max(1, min(case.rays, PIXELS) // n**2))
    scene = scene.model_copy(update={"shapes": []})
    pixel = grid(scene)
    sub_ray = np.random.default_rng([case.seed, 4]).integers(n**2, size=len(pixel))
    rays, ours = true_rays(case, scene, pixel, sub_ray), our_rays(case, scene, pixel, sub_ray)
    o, d = rays.o, rays.d
    chosen = np.arange(len(pixel)) * n**2 + sub_ray
    their_o, their_d = (v[chosen] for v in mitsuba_scene.build(scene, supersample=n).camera_rays())
    theirs = their_o, their_d
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
