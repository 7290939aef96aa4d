"""Terms of the camera: the rays through pixel centers, and the depth buffer as a picture."""

from __future__ import annotations

import numpy as np

import tracer
from reference import extended, mitsuba_scene
from reference.comparison.case import Case, roundness, sizes, small_picture, truth_of_hits
from reference.comparison.hits import farther, has_shapes, rim_clearance
from reference.comparison.judge import (
    SINGLE,
    Answers,
    Numbers,
    bounds,
    hit_distance,
    judge_ids,
    judge_numbers,
)
from reference.comparison.rays import RaySet, pixel_offset
from reference.comparison.records import Outcome, Term
from reference.tolerances import TOLERANCES
from tracer.backends import exact_arithmetic, find_backend
from tracer.canvas import Canvas, DeviceCanvas
from tracer.whitted import PixelGrid, primary_ray

Array = np.ndarray


def grid(scene: tracer.Scene) -> Array:
    """(n, 2) column and row of every pixel, row by row."""
    width, height = scene.camera.resolution
    number = np.arange(width * height)
    return np.stack([number % width, number // width], axis=1)


def named_pixels(case: Case, scene: tracer.Scene, pixel: Array) -> Array:
    """Pixels as a replay names them: -1 in a picture smaller than the scene's, whose pixels are others."""
    return pixel if scene.camera.resolution == case.scene.camera.resolution else np.full_like(pixel, -1)


def our_rays(case: Case, scene: tracer.Scene, pixel: Array) -> tuple[Array, Array]:
    """Origins and directions (n, 3) of the renderer's primary rays through pixels."""
    types = find_backend(case.backend, case.precision)
    column, row = (types.UInt32(np.ascontiguousarray(c, np.uint32)) for c in pixel.T)
    with exact_arithmetic():
        canvas = DeviceCanvas.of(types, Canvas.of(scene.camera, scene.literal))
        pixels = PixelGrid(column, row, types.UInt32(0), types.opaque_id(1), types.Bool(True))
        o, d = primary_ray(types, canvas, pixels, types.UInt32(0))
        return o.numpy().T.astype(np.float64), d.numpy().T.astype(np.float64)


def exact_rays(scene: tracer.Scene, pixel: Array) -> tuple[Array, Array]:
    """The same from the numbers of the scene file, in extended precision rounded once."""
    offset = pixel_offset(scene)
    o, d = extended.camera_rays(scene.camera, pixel[:, 0] + offset, pixel[:, 1] + offset)
    return extended.double(o), extended.double(d)


def compare_camera(case: Case) -> Outcome:
    """Origins in eps S, S the largest |coordinate| of canvas and eye, and directions in eps: the larger of
    the two errors of each ray."""
    scene = small_picture(case.bench.scene, case.rays)
    pixel = grid(scene)
    o, d = exact_rays(scene, pixel)
    rays = RaySet(o, d, named_pixels(case, scene, pixel))
    theirs = mitsuba_scene.build(scene).camera_rays()
    ours = our_rays(case, scene, pixel)
    eye = o - scene.camera.eye_distance * d
    extent = max(float(np.abs(o).max()), float(np.abs(eye).max()))

    def error(a: tuple[Array, Array], b: tuple[Array, Array], epsilon: float) -> Array:
        place, way = (np.abs(x - y).max(axis=1) for x, y in zip(a, b, strict=True))
        return np.maximum(place / extent, way) / epsilon

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


class DepthBuffers:
    """The depth buffers of both sides of a small picture, with closed forms where both hit the same shape."""

    def __init__(self, case: Case) -> None:
        self.scene = scene = small_picture(case.bench.scene, case.rays)
        theirs = mitsuba_scene.build(scene)
        result = tracer.render(
            scene, case.precision, case.backend, supersample=1, aovs=("depth", "shape", "primitive")
        )
        self.pixel = grid(scene)
        self.rays = RaySet(*exact_rays(scene, self.pixel), named_pixels(case, scene, self.pixel))
        self.ours = result.depth.ravel().astype(np.float64)
        self.theirs = theirs.depth_buffer().ravel()
        self.shape = result.aovs["shape"].ravel().astype(np.int64)
        self.primitive = result.aovs["primitive"].ravel().astype(np.int64)
        self.hits = theirs.intersect(*theirs.camera_rays())


def depth_buffers(case: Case) -> DepthBuffers:
    """The buffers, rendered once a case."""
    if "depth" not in case.memory:
        case.memory["depth"] = DepthBuffers(case)
    buffers: DepthBuffers = case.memory["depth"]
    return buffers


def compare_mask(case: Case) -> Outcome:
    """What each pixel shows: shape and primitive of our layers against Mitsuba's hits, and blank pixels of
    Mitsuba's depth integrator."""
    b = depth_buffers(case)
    blank = b.theirs < 0
    ours = Answers(b.shape, b.primitive)
    theirs = Answers(np.where(blank, -1, b.hits.shape), np.where(blank, -1, b.hits.primitive))
    reach = farther(b.ours, b.theirs)
    return judge_ids(
        case,
        "depth buffer, mask",
        b.rays,
        ours,
        theirs,
        lambda k: hit_distance(case, b.rays, k, ours, theirs, reach),
    )


def compare_depth(case: Case) -> Outcome:
    """|dt cos| of the pixels where both sides show the same primitive, in eps S."""
    b, truth = depth_buffers(case), case.bench.truth
    k = np.flatnonzero((b.shape >= 0) & (b.theirs >= 0) & (b.shape == b.hits.shape))
    k = k[b.primitive[k] == b.hits.primitive[k]]
    t, normal = truth_of_hits(truth, b.rays.part(k), b.shape[k], b.primitive[k])
    cosine = np.abs((normal * b.rays.d[k]).sum(axis=1))
    radius, condition = roundness(truth, b.shape[k], b.primitive[k])
    extent = sizes(truth, b.rays.o[k], b.rays.o[k] + t[:, None] * b.rays.d[k])
    # Both sides make rays of their own, so their rims lie farther apart than those of one ray.
    clear = rim_clearance(radius, cosine) > 2 * TOLERANCES["grazing band"].value * SINGLE * extent
    k, t, cosine, condition, extent = (a[clear] for a in (k, t, cosine, condition, extent))
    unit = extent / cosine
    # Mitsuba's rays come from the eye, so its place counts among the coordinates.
    eye = b.rays.o[k] - b.scene.camera.eye_distance * b.rays.d[k]
    their_unit = SINGLE * sizes(truth, eye, b.rays.o[k]).clip(min=extent) / cosine * condition
    numbers = Numbers(
        rays=b.rays,
        index=k,
        difference=np.abs(b.ours[k] - b.theirs[k]) / their_unit,
        ours=np.abs(b.ours[k] - t) / (case.epsilon * unit),
        mitsuba=np.abs(b.theirs[k] - t) / their_unit,
        unit="eps S / cos",
        answers=lambda i: (f"depth {b.ours[k[i]]!s}", f"depth {b.theirs[k[i]]!s}", f"depth {t[i]!s}"),
    )
    return judge_numbers(case, "depth buffer", numbers, bounds(case, "depth buffer", "mitsuba depth buffer"))


def terms() -> list[Term]:
    """Camera rays, the mask of the depth buffer, and its depths."""
    return [
        Term(
            "camera rays", "origin and direction of the ray of each pixel", lambda scene: True, compare_camera
        ),
        Term(
            "depth buffer, mask", "which pixels are blank, and what the others show", has_shapes, compare_mask
        ),
        Term("depth buffer", "distance from the canvas, as a picture", has_shapes, compare_depth),
    ]
