"""One ray again: what both tracers and extended precision say at every vertex, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import tracer
from reference import extended, plain, whitted
from reference.comparison.case import Case
from reference.comparison.materials import material_of
from reference.comparison.rays import RaySet, single
from reference.comparison.replay_sides import OURS, Side, sides_of
from reference.tolerances import EPSILON
from reference.whitted_tables import plain_world
from reference.whitted_world import CUTOFF_SLACK
from tracer.errors import UsageError

Array = np.ndarray

DEEPEST = 8
"""Vertices of a chain that are shown, at most."""

MOST = 32
"""Vertices that are shown, at most."""


@dataclass(frozen=True)
class Vertex:
    """A vertex of the tree of a ray: the `events` that lead there (R mirror, T refraction), its `weight`, and
    what each side says of it."""

    events: str
    weight: float
    sides: dict[str, Side]


def pixel_ray(case: Case, column: int, row: int) -> RaySet:
    """The ray through the center of a pixel, as the comparison asks it."""
    width, height = case.scene.camera.resolution
    if not (0 <= column < width and 0 <= row < height):
        raise UsageError(
            f"--pixel: {column} {row} is outside the picture; allowed are columns 0 to {width - 1} and "
            f"rows 0 to {height - 1}"
        )
    offset = extended.pixel_offset(case.scene.camera, case.scene.literal)
    o, d = extended.camera_rays(case.bench.scene.camera, [column + offset], [row + offset])
    return RaySet(single(extended.double(o)), single(extended.double(d)), np.array([[column, row]]))


def pixel_colors(case: Case, column: int, row: int) -> list[list[float]]:
    """The color of a pixel by all sides, with one ray through its center: ours in both precisions, on
    Mitsuba's hits, and by the plain version, which has double precision."""
    camera = case.scene.camera.model_copy(update={"depth_of_field": None})
    scene, crop = case.scene.model_copy(update={"camera": camera}), (column, row, column + 1, row + 1)
    pictures: list[Any] = [
        tracer.render(scene, precision, case.backend, supersample=1, crop=crop) for precision in OURS.values()
    ]
    pictures.append(whitted.render(scene, 1, crop))
    pictures.append(plain.render(plain_world(scene), supersample=1, crop=crop))
    return [[float(x) for x in picture.color[0, 0]] for picture in pictures]


def free_ray(numbers: Sequence[float]) -> RaySet:
    """The ray of six numbers, origin and direction, which need not have unit length."""
    o, d = np.array(numbers[:3]), np.array(numbers[3:])
    length = np.linalg.norm(d)
    if not np.isfinite([*numbers]).all() or length == 0:
        raise UsageError(
            f"--ray: {' '.join(map(str, numbers))}; allowed are finite numbers, no zero direction"
        )
    unit = d if abs(length - 1) < 4 * EPSILON["single"] else d / length
    return RaySet(o[None], unit[None], np.full((1, 2), -1))


def replay_ray(case: Case, ray: RaySet, events: str | None = None) -> list[Vertex]:
    """The vertices of a ray, the nearest to the eye first: along one chain of `events`, else all that the
    model reaches, as far as `DEEPEST` and `MOST` allow."""
    vertices: list[Vertex] = []
    waiting = [("", 1.0)]
    while waiting and len(vertices) < MOST:
        letters, weight = waiting.pop(0)
        vertex = Vertex(letters, weight, sides_of(case, ray, letters))
        vertices.append(vertex)
        if vertex.sides["ours, double"].shape >= 0:
            waiting += _children(case, vertex, events)
    return vertices


def _children(case: Case, vertex: Vertex, events: str | None) -> list[tuple[str, float]]:
    """Letters and weights of the vertices that follow."""
    letters, side = vertex.events, vertex.sides["ours, double"]
    if events is not None:
        children = [(events[: len(letters) + 1], vertex.weight)] if len(letters) < len(events) else []
    else:
        material = material_of(case.scene, side.shape)
        shares = {"R": material.reflection, "T": material.refraction} if len(letters) < DEEPEST - 1 else {}
        weights = {letter: vertex.weight * share for letter, share in shares.items() if share > 0}
        heavy = {k: weight for k, weight in weights.items() if weight > case.scene.cutoff - CUTOFF_SLACK}
        children = [(letters + letter, weight) for letter, weight in heavy.items()]
    ways = {"R": side.mirrored, "T": side.refracted}
    return [child for child in children if np.isfinite(ways[child[0][-1]]).all()]
