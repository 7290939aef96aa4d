"""Meshes, points on them and lights drawn at random, one configuration to a lane, and each verdict on a whole
light held against the shadow rays to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from tests.accuracy import worlds
from tests.accuracy.probe import compiled, directions, rotation, unit, upload
from tests.accuracy.shafts import log_uniform, numbers, report, vectors
from tracer.acceleration import beam
from tracer.acceleration.triangle import Triangle, meet_triangle, projection_axes
from tracer.arrival import segment_to
from tracer.backends import exact_arithmetic, find_backend
from tracer.device_scene import DeviceScene
from tracer.intersection import closest_hit, free_ray
from tracer.light_tables import LightSample
from tracer.occlusion import hidden_by_many
from tracer.ray import Ray, normalize
from tracer.shafts import CONTACT_REACH, Ball, Shaft, Suspects
from tracer.shapes import Mesh
from tracer.shapes.triangles import MeshData, place_mesh
from tracer.surface import Surface, surface_at
from tracer.suspects import find_suspects

Array = np.ndarray


def triangle_mesh(corners: Array, **keys: Any) -> dict[str, Any]:
    """Triangles (m, 3, 3) that share no vertex."""
    faces = np.arange(3 * len(corners)).reshape(-1, 3)
    return {"kind": "mesh", "vertices": corners.reshape(-1, 3).tolist(), "faces": faces.tolist()} | keys


def solid(name: str, rng: np.random.Generator) -> dict[str, Any]:
    """A closed convex mesh of about unit size around the origin, turned at random."""
    if name == "cube":
        shape = worlds.cube()
    elif name == "tetrahedron":
        corners = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
        shape = {"kind": "mesh", "vertices": corners, "faces": [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]}
    else:
        vertices, faces = worlds.icosphere(1)
        shape = {"kind": "mesh", "vertices": vertices.tolist(), "faces": faces.tolist()}
    return shape | {"vertices": (np.array(shape["vertices"]) @ rotation(rng).T).tolist()}


def moved(shape: dict[str, Any], offset: Any, scale: float = 1.0) -> dict[str, Any]:
    return shape | {"vertices": (np.array(shape["vertices"]) * scale + offset).tolist()}


def soup(rng: np.random.Generator) -> list[dict[str, Any]]:
    count = 40
    middle = rng.uniform(-2, 2, (count, 1, 3))
    return [
        triangle_mesh(
            middle + rng.normal(size=(count, 3, 3)) * log_uniform(rng, -2, 0.3, count)[:, None, None]
        )
    ]


def solids(rng: np.random.Generator) -> list[dict[str, Any]]:
    names = ["icosphere", "cube", "tetrahedron"]
    return [moved(solid(name, rng), rng.uniform(-2, 2, 3), rng.uniform(0.4, 1.2)) for name in names]


def smooth_solids(rng: np.random.Generator) -> list[dict[str, Any]]:
    return [shape | {"smooth": True} for shape in solids(rng)]


def wall_on_floor(rng: np.random.Generator) -> list[dict[str, Any]]:
    """Two triangles of a floor, a wall and a box that stand on it, and a ramp that begins at its level."""
    turn = rotation(rng)
    floor = [[-4, 0, -4], [-4, 0, 4], [4, 0, 4], [4, 0, -4]]
    wall = [[-2, 0, -1], [2, 0, -1], [2, 2, -1], [-2, 2, -1]]
    ramp = [[-1, 0, 1], [1, 0, 1], [1, 0.3, 3], [-1, 0.3, 3]]
    box = np.array(worlds.cube()["vertices"]) * 0.5 + [1.5, 0.5, 2]
    shapes = [{"kind": "mesh", "vertices": v, "faces": [[0, 1, 2, 3]]} for v in (floor, wall, ramp)]
    shapes.append(worlds.cube() | {"vertices": box.tolist()})
    offset = rng.uniform(-3, 3, 3)
    return [
        shape | {"vertices": (np.array(shape["vertices"]) @ turn.T + offset).tolist()} for shape in shapes
    ]


def slivers_over_plane(rng: np.random.Generator) -> list[dict[str, Any]]:
    """Long thin triangles that hover and dip within 1e-15 to 1e-1 of a plane."""
    count = 60
    along = rng.uniform(0, 2 * np.pi, count)
    width = log_uniform(rng, -5, -0.5, count)
    height = log_uniform(rng, -15, -1, count)[:, None] * rng.uniform(-0.3, 1, (count, 3))
    u = np.stack([np.cos(along), 0 * along, np.sin(along)], axis=1)
    v = np.stack([-u[:, 2], 0 * along, u[:, 0]], axis=1)
    corners = np.stack([-u, u - v * width[:, None], u + v * width[:, None]], axis=1) * rng.uniform(0.2, 1.5)
    corners[..., 1] += height
    corners += np.stack([rng.uniform(-1, 1, count), 0 * along, rng.uniform(-1, 1, count)], axis=1)[:, None]
    return [{"kind": "plane", "coefficients": [0, 1, 0, 0]}, triangle_mesh(corners)]


@dataclass
class Stand:
    """Where rays hit a scene: `surface`, and `ray`, `valid` as NumPy mask, `p`, `lit_side` (n, 3)."""

    ray: Ray
    surface: Surface
    valid: Array
    p: Array
    lit_side: Array


def stand_on(scene: DeviceScene, targets: Array, rng: np.random.Generator) -> Stand:
    """Hits of rays aimed at points (n, 3)."""
    n = len(targets)
    d = directions(rng, n)
    d[:, 1] = -np.abs(d[:, 1])  # planes are seen from above
    o = (
        targets
        - d * np.where(rng.random(n) < 0.5, rng.uniform(0.5, 6, n), log_uniform(rng, -15, -1, n))[:, None]
    )
    ray = free_ray(scene, upload(scene, o), normalize(upload(scene, d)))
    everything = dr.full(scene.backend.Bool, True, n)
    hit = closest_hit(scene, ray, everything)
    surface = surface_at(scene, ray, hit, everything)
    valid = hit.valid
    dr.eval(ray, surface, valid)
    host = (v.numpy().T.astype(np.float64) for v in (surface.p, surface.lit_side))
    return Stand(ray, surface, valid.numpy(), *(np.where(valid.numpy()[:, None], v, 0) for v in host))


def inside_of(corners: Array, rng: np.random.Generator) -> Array:
    """Points (n, 3) of triangles with corners (n, 3, 3), most of them near an edge or a corner."""
    n = len(corners)
    little = np.where(rng.random((n, 3)) < 0.4, log_uniform(rng, -8, 0, n)[:, None], 1)
    weights = rng.dirichlet([1, 1, 1], n) * little
    return (weights[..., None] * corners).sum(axis=1) / weights.sum(axis=1)[:, None]


@dataclass
class Lights:
    """A light for each lane: center and radius, and points (k, n, 3) of it."""

    c: Array
    radius: Array
    points: list[Array]


def lights_around(stand: Stand, chosen: Array, rng: np.random.Generator, k: int) -> Lights:
    """Lights that are seen next to, behind, across or in front of the edges and middles of triangles with
    corners (n, 3, 3), or of any others of them."""
    n = len(stand.p)
    chosen = np.where(rng.integers(2, size=(n, 1, 1)), chosen, rng.permutation(chosen))
    # Half of the lights touch, but for a small number, the plane through the point and an edge.
    tangent = rng.integers(2, size=n)[:, None] > 0
    lane, corner = np.arange(n), rng.integers(3, size=n)
    start, edge = chosen[lane, corner], chosen[lane, corner - 1] - chosen[lane, corner]
    way = np.where(tangent, start + rng.random((n, 1)) * edge, inside_of(chosen, rng)) - stand.p
    way = np.where(rng.integers(4, size=n)[:, None] == 0, directions(rng, n), way)
    way = way * log_uniform(rng, -0.5, 1.5, n)[:, None]
    length = np.maximum(np.linalg.norm(way, axis=1), 1e-9)
    side = np.cross(way / length[:, None], np.where(tangent, edge, directions(rng, n)))
    side /= np.maximum(np.linalg.norm(side, axis=1), 1e-30)[:, None]
    radius = length * log_uniform(rng, -6, 0, n) * (rng.random(n) > 0.2)
    shift = radius * (rng.choice([0, 1, -1], n) + log_uniform(rng, -8, 0, n) * rng.choice([-1, 1], n))
    c = stand.p + way + side * shift[:, None]
    normals = [side, -side, unit(c - stand.p), unit(stand.p - c)]
    normals += [directions(rng, n) for _ in range(k)]
    return Lights(c, radius, [c + normal * radius[:, None] for normal in normals])


@dataclass
class BeamVerdicts:
    """Of n lanes: the verdict on the light, whether `some` and `every` lit sample is hidden, whether any is
    `lit`, and what a report shows."""

    verdict: Array
    some: Array
    every: Array
    lit: Array
    lanes: Any


@dataclass
class Lane:
    """What a report shows of a lane."""

    p: Array
    normal: Array
    c: Array
    radius: Array


def light_balls(scene: DeviceScene, lights: Lights) -> Ball:
    """The balls that hold the lights, as the tables of a scene have them."""
    extent = np.abs(lights.c).max(axis=1) + lights.radius
    held = lights.radius + CONTACT_REACH * scene.backend.epsilon * extent
    return Ball(vectors(scene.backend, lights.c), numbers(scene.backend, held))


def ask_triangles(scene: DeviceScene, stand: Stand, lights: Lights) -> BeamVerdicts:
    assert scene.triangles is not None
    surface, valid = stand.surface, scene.backend.Bool(stand.valid)
    shaft = Shaft.of(scene.backend, surface.p, light_balls(scene, lights))
    verdict = beam.look_along(
        scene.backend, scene.triangles, shaft, surface.lit_side, surface.primitive, valid
    )
    return beside_shadow_rays(scene, stand, lights, verdict.numpy())


def ask_many_spheres(scene: DeviceScene, stand: Stand, lights: Lights) -> BeamVerdicts:
    who = find_suspects(
        scene,
        stand.surface,
        light_balls(scene, lights),
        scene.backend.Bool(stand.valid),
        spheres=True,
        beams=True,
    )
    suspect, umbra = who.many.numpy(), who.umbra.numpy()
    assert suspect[umbra].all()
    verdict = np.where(umbra, beam.COVERED, np.where(suspect, beam.DOUBTFUL, beam.CLEAR))
    return beside_shadow_rays(scene, stand, lights, verdict)


def beside_shadow_rays(scene: DeviceScene, stand: Stand, lights: Lights, verdict: Array) -> BeamVerdicts:
    """Verdicts (n,) together with what shadow rays to all points of the lights say."""
    backend, n = scene.backend, len(stand.p)
    surface, valid = stand.surface, backend.Bool(stand.valid)
    some, every, any_lit = np.zeros(n, bool), np.ones(n, bool), np.zeros(n, bool)
    nowhere = dr.zeros(backend.UInt32, n)
    for light in lights.points:
        segment = segment_to(stand.ray, surface, LightSample(vectors(backend, light), nowhere, nowhere))
        lit = valid & (dr.dot(surface.lit_side, segment.ray.d) > 0) & (segment.length > 0)
        blocked = hidden_by_many(scene, segment, surface, Suspects.everybody(backend, n), lit)
        is_lit, is_blocked = lit.numpy(), blocked.numpy()
        some, every, any_lit = some | is_blocked, every & (is_blocked | ~is_lit), any_lit | is_lit
    return BeamVerdicts(verdict, some, every, any_lit, Lane(stand.p, stand.lit_side, lights.c, lights.radius))


def check_triangles(
    make: Callable[[np.random.Generator], list[dict[str, Any]]], precision: str, n: int, seed: int, k: int = 3
) -> BeamVerdicts:
    rng = np.random.default_rng(seed)
    scene = compiled({"shapes": make(rng)}, precision)
    corners = np.concatenate([mesh.corners for mesh in scene.host.meshes.values()])
    chosen = corners[rng.integers(len(corners), size=n)]
    targets = inside_of(chosen, rng)
    if make is slivers_over_plane:
        targets[:, 1] *= rng.integers(2, size=n)
    with exact_arithmetic():
        stand = stand_on(scene, targets, rng)
        found = ask_triangles(scene, stand, lights_around(stand, chosen, rng, k))
    report_wrong(found)
    assert stand.valid.mean() > 0.7 and found.lit.mean() > 0.2
    return found


def report_wrong(found: BeamVerdicts) -> None:
    report("clear, yet a shadow ray is blocked", (found.verdict == beam.CLEAR) & found.some, found.lanes)
    covered = found.verdict == beam.COVERED
    report("covered, yet a shadow ray passes", covered & found.lit & ~found.every, found.lanes)


def check_many_spheres(precision: str, n: int, seed: int, count: int = 60) -> BeamVerdicts:
    """Spheres of all sizes, some of them around others; lights seen through them."""
    rng = np.random.default_rng(seed)
    center, radius = rng.uniform(-2, 2, (count, 3)), 0.8 * log_uniform(rng, -1.5, 0, count)
    shapes = [
        {"kind": "sphere", "center": c.tolist(), "radius": r}
        for c, r in zip(center, radius.tolist(), strict=True)
    ]
    scene = compiled({"shapes": shapes}, precision)
    number = rng.integers(count, size=n)
    corners = center[number, None] + radius[number, None, None] * unit(rng.normal(size=(n, 3, 3)))
    with exact_arithmetic():
        stand = stand_on(scene, corners[:, 0], rng)
        found = ask_many_spheres(scene, stand, lights_around(stand, corners, rng, 3))
    report_wrong(found)
    return found


@dataclass
class Lone:
    """A point, a triangle and a light in each of n lanes."""

    p: Array
    corners: Array
    c: Array
    radius: Array


def slivers(rng: np.random.Generator, n: int) -> Lone:
    """Triangles of every width close above and below points, with the light on the other side."""
    size = log_uniform(rng, -3, 3, n)
    width, height = log_uniform(rng, -5, -1, n), log_uniform(rng, -6, -1, n) * rng.choice([-1, 1], n)
    u, w = directions(rng, n), directions(rng, n)
    v = unit(np.cross(u, w))
    normal = np.cross(u, v)
    across = v * width[:, None]
    corners = np.stack([-u, u - across * rng.random((n, 1)), u + across * rng.random((n, 1))], axis=1)
    corners += (normal * height[:, None])[:, None]
    corners = corners - across[:, None] * rng.choice([0, 0.2], n)[:, None, None]
    at_origin = rng.integers(2, size=n)
    p = directions(rng, n) * (rng.random(n) * at_origin)[:, None]
    aimed = inside_of(corners, rng) + across * (rng.normal(size=n) * log_uniform(rng, -3, 1, n))[:, None]
    away = normal * (np.sign(height) * log_uniform(rng, -2, 1, n) * (np.abs(height) + width))[:, None]
    c = aimed + away + directions(rng, n) * (width * log_uniform(rng, -3, 0, n))[:, None]
    radius = np.linalg.norm(away, axis=1) * log_uniform(rng, -6, -0.5, n)
    scale = size[:, None]
    return Lone(p * scale, (corners + p[:, None]) * scale[..., None], (c + p) * scale, radius * size)


def check_lone(precision: str, n: int, points: int, seed: int = 1) -> Array:
    """The verdict on one triangle against the test of single rays with it; (n,) verdicts."""
    backend = find_backend("llvm", precision)
    rng = np.random.default_rng(seed)
    lone = slivers(rng, n)
    lone.corners = lone.corners.astype(np.float32).astype(np.float64)
    normals = place_mesh(
        MeshData(
            lone.corners.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3), np.arange(n), np.zeros((0, 3, 3))
        ),
        Mesh(builtin="cube").placement,
    ).normals
    with exact_arithmetic():
        p = vectors(backend, lone.p)
        lone.p = p.numpy().T.astype(np.float64)
        a, b, c = (vectors(backend, lone.corners[:, k]) for k in range(3))
        triangle = Triangle(a, b, c, vectors(backend, normals), edge=None)
        up = vectors(backend, unit(lone.c - lone.p))
        held = lone.radius + CONTACT_REACH * backend.epsilon * (np.abs(lone.c).max(axis=1) + lone.radius)
        shaft = Shaft.of(backend, p, Ball(vectors(backend, lone.c), numbers(backend, held)))
        verdict = beam._meet(backend, triangle, shaft, up).numpy()
        some, every = np.zeros(n, bool), np.ones(n, bool)
        for _ in range(points):
            light = vectors(backend, lone.c + directions(rng, n) * lone.radius[:, None])
            length = dr.sqrt(dr.squared_norm(light - p))
            ray = Ray(p, (light - p) * dr.rcp(length), None, None, None)
            met = meet_triangle(backend.epsilon, triangle, ray, projection_axes(ray.d))
            sure = dr.abs(met.height) > met.slack
            blocked = (sure & met.within & (met.t > 0) & (met.t <= length)).numpy()
            some, every = some | blocked, every & blocked
    report("clear, yet a ray meets the triangle", (verdict == beam.CLEAR) & some, lone)
    report("covered, yet a ray misses the triangle", (verdict == beam.COVERED) & ~every, lone)
    assert some.mean() > 0.1 and (verdict == beam.COVERED).mean() > 0.005
    return verdict
