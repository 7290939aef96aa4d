"""One ray again: what both tracers and extended precision say at every vertex, side by side.

Mitsuba is asked in lockstep: it is given our vertex and direction in double precision, rounded to single.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import tracer
from reference import extended, plain, whitted
from reference.comparison import optics
from reference.comparison.case import Case
from reference.comparison.rays import RaySet, single
from reference.comparison.steps import step_length
from reference.comparison.truth import material_of
from reference.comparison.visibility import exact_visibility
from reference.tolerances import EPSILON
from reference.whitted_tables import plain_world
from tracer.errors import UsageError
from tracer.queries import END_GUARD

Array = np.ndarray

OURS = {"ours, double": "double", "ours, single": "single"}
SIDES = (*OURS, "Mitsuba", "extended")

DEEPEST = 8
"""Vertices of a chain that are shown, at most."""

MOST = 32
"""Vertices that are shown, at most."""

CUTOFF_SLACK = 1e-6
"""The model's: a product of shares that meets the cut-off in decimals is traced."""

NOTHING = [float("nan")] * 3


@dataclass(frozen=True)
class Side:
    """What one side says of a vertex: `shape`, `primitive` (-1: nothing is hit), distance `t`, `position`,
    the directions of the children `mirrored` and `refracted` (NaN: none), and by light how many of its
    samples are `seen`."""

    shape: int
    primitive: int
    t: float
    position: list[float]
    mirrored: list[float]
    refracted: list[float]
    seen: list[int] = field(default_factory=list)


NOBODY = Side(-1, -1, float("nan"), NOTHING, NOTHING, NOTHING)


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
        vertex = Vertex(letters, weight, _sides(case, ray, letters))
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


def _sides(case: Case, ray: RaySet, letters: str) -> dict[str, Side]:
    v = len(letters)
    paths = {name: _path(case, ray, letters, precision) for name, precision in OURS.items()}
    lead = paths["ours, double"]
    o, d = (lead.position[0, v - 1], lead.direction[0, v - 1]) if v else (ray.o[0], ray.d[0])
    left = (int(lead.shape[0, v - 1]), int(lead.primitive[0, v - 1])) if v else (-1, -1)
    sides = {name: _our_side(path, ray, v) for name, path in paths.items()}
    sides["Mitsuba"] = _mitsuba_side(case, o, d, v)
    sides["extended"] = _exact_side(case, o, d, left)
    at = lead.position[0, v]
    if np.isfinite(at).all():
        sides = {name: replace(side, seen=_seen(case, at, name)) for name, side in sides.items()}
    return sides


def _path(case: Case, ray: RaySet, letters: str, precision: str) -> tracer.Paths:
    """Our chain to the vertex and on: mirrored in the first row, refracted in the second."""
    o, d = np.repeat(ray.o, 2, axis=0), np.repeat(ray.d, 2, axis=0)
    events = [letters + "R", letters + "T"]
    return tracer.trace_path(case.bench.scene, o, d, events, precision=precision, backend=case.backend)


def _our_side(path: tracer.Paths, ray: RaySet, v: int) -> Side:
    start = path.position[0, v - 1] if v else ray.o[0]
    position, mirrored, refracted = path.position[0, v], path.direction[0, v], path.direction[1, v]
    return Side(
        shape=int(path.shape[0, v]),
        primitive=int(path.primitive[0, v]),
        t=float(np.linalg.norm(position - start)),
        position=position.tolist(),
        mirrored=mirrored.tolist(),
        refracted=refracted.tolist(),
    )


def _mitsuba_side(case: Case, o: Array, d: Array, v: int) -> Side:
    """Mitsuba's answer to our question: its ray starts a step later, its materials get its own normal."""
    step = step_length(case, o[None])[0] if v else 0.0
    origin, way = single(o[None] + step * d), single(d[None])
    hits = case.bench.mitsuba.intersect(origin, way)
    if not hits.valid[0]:
        return NOBODY
    truth, ior = case.bench.truth, case.bench.truth.ior[hits.shape]
    normal, entering, _ = truth.shading(hits.p, way, hits.shape, hits.primitive)
    facing = single(extended.double(normal))
    mirrored = optics.mirrored(way, facing)
    refracted, total = way, np.array([False])
    if ior[0] != 1:
        refracted, total = optics.refracted(way, np.where(entering[:, None], facing, -facing), ior)
    return Side(
        shape=int(hits.shape[0]),
        primitive=int(hits.primitive[0]),
        t=float(np.linalg.norm(hits.p[0] - o)),
        position=hits.p[0].tolist(),
        mirrored=mirrored[0].tolist(),
        refracted=NOTHING if total[0] else refracted[0].tolist(),
    )


def _exact_side(case: Case, o: Array, d: Array, left: tuple[int, int]) -> Side:
    """Closed forms: the nearest crossing that is not the start of the ray."""
    truth, way = case.bench.truth, extended.unit(d[None])
    shapes, primitives, t = truth.nearest(o[None], d[None], (np.array([left[0]]), np.array([left[1]])))
    number, which, distance = int(shapes[0]), int(primitives[0]), float(t[0])
    if number < 0:
        return NOBODY
    numbers = np.array([number]), np.array([which])
    p = extended.number(o[None]) + extended.number(distance) * way
    normal, entering, _ = truth.shading(p, way, *numbers)
    ior = extended.number(truth.ior[numbers[0]])
    refracted, k = extended.refract(way, normal, np.where(entering, 1 / ior, ior))
    straight = truth.ior[number] == 1
    return Side(
        shape=number,
        primitive=which,
        t=distance,
        position=extended.double(p)[0].tolist(),
        mirrored=extended.double(extended.mirror(way, normal))[0].tolist(),
        refracted=NOTHING
        if k[0] < 0 and not straight
        else extended.double(way if straight else refracted)[0].tolist(),
    )


def _seen(case: Case, at: Array, name: str) -> list[int]:
    """Samples of each light that are seen from our vertex."""
    truth = case.bench.truth
    light = single(truth.lights)
    p = np.repeat(at[None], len(light), axis=0)
    if not len(light):
        return []
    if name in OURS:
        seen = tracer.visible(case.bench.scene, p, light, precision=OURS[name], backend=case.backend)
    elif name == "Mitsuba":
        seen = case.bench.mitsuba.visible(p, light)
    else:
        seen = exact_visibility(truth, p, light, END_GUARD["double"] * case.bench.mitsuba.extent)
    return [int(part.sum()) for part in np.split(seen, truth.first_light[1:-1])]
