"""What each side says of one vertex of a replayed ray.

Mitsuba is asked in lockstep: it is given our vertex and direction in double precision, rounded to single.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

import tracer
from reference import extended
from reference.comparison import optics
from reference.comparison.case import Case
from reference.comparison.rays import RaySet, single
from reference.comparison.steps import step_length
from reference.comparison.visibility import exact_visibility
from tracer.queries import END_GUARD

Array = np.ndarray

OURS = {"ours, double": "double", "ours, single": "single"}
SIDES = (*OURS, "Mitsuba", "extended")

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


def sides_of(case: Case, ray: RaySet, letters: str) -> dict[str, Side]:
    """By side, the vertex that a ray reaches after the events `letters`."""
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
