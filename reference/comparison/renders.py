"""Our picture of a case, small and without depth of field, and the rays of its pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import tracer
from reference import extended, mitsuba_scene
from reference.comparison.case import Case, once_a_case, once_a_scene
from reference.comparison.rays import PictureRays, RaySet

Array = np.ndarray


@dataclass(frozen=True)
class Render:
    """A small picture. `scene` with that camera; `result` with depth, shape and primitive; `rays` of the
    pixels' centers, row by row."""

    scene: tracer.Scene
    result: tracer.Result
    rays: RaySet


@once_a_case
def render_of(case: Case) -> Render:
    """The picture, one ray a pixel."""
    scene = case.bench.small
    result = tracer.render(
        scene, case.precision, case.backend, supersample=1, aovs=("depth", "shape", "primitive")
    )
    return Render(scene, result, pixel_centers(case, scene))


@once_a_scene
def small_mitsuba(case: Case) -> mitsuba_scene.MitsubaScene:
    """The scene of small pictures in Mitsuba."""
    return mitsuba_scene.build(case.bench.small)


def grid(scene: tracer.Scene) -> Array:
    """(n, 2) column and row of every pixel, row by row."""
    width, height = scene.camera.resolution
    number = np.arange(width * height)
    return np.stack([number % width, number // width], axis=1)


def pixel_centers(case: Case, scene: tracer.Scene) -> RaySet:
    """The rays of all pixels of a small picture, from the numbers of the scene file, in extended precision
    rounded once to doubles."""
    pixel, camera = grid(scene), scene.camera
    offset = extended.pixel_offset(camera, scene.literal)
    o, d = (
        extended.double(v) for v in extended.camera_rays(camera, pixel[:, 0] + offset, pixel[:, 1] + offset)
    )
    if camera.resolution == case.scene.camera.resolution:
        return RaySet(o, d, pixel)
    if case.words.startswith("--random"):  # takes no settings: the ray itself has to do
        return RaySet(o, d, np.full_like(pixel, -1))
    settings = f"--set camera.resolution=[{camera.resolution[0]},{camera.resolution[1]}]"
    if not camera.is_look_at:
        settings += f" --set camera.pixel_size={camera.pixel_size!r}"
    return PictureRays(o, d, pixel, settings)


def distance(color: Array, depth: Array, other: Array, other_depth: Array) -> Array:
    """(h, w) the largest difference of a channel; infinite where one picture is blank and the other not."""
    apart = np.abs(color - other).max(axis=2)
    return np.where((depth < 0) != (other_depth < 0), np.inf, apart)
