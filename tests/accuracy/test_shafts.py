"""What spares shadow rays changes no picture: each verdict on a whole light against the shadow rays.

Lights, blockers and points are drawn at random, many of them within rounding of being tangent. A lane is one
such configuration, with a light of its own.
"""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np
import pytest

import tracer
from tests.accuracy import worlds
from tests.accuracy.probe import compiled, directions, rotation, unit, upload
from tracer import direct_light, light_tables
from tracer.acceleration import beam
from tracer.acceleration.triangle import Triangle, meet_triangle, projection_axes
from tracer.backends import Backend, exact_arithmetic, find_backend
from tracer.device_meshes import is_convex
from tracer.device_scene import DeviceScene
from tracer.direct_light import segment_to
from tracer.intersection import Surface, closest_hit, free_ray, surface_at
from tracer.light_tables import LightSample, fetch_ball, fetch_sample
from tracer.occlusion import hidden_by_many
from tracer.ray import Ray, Segment, normalize
from tracer.shafts import CONTACT_REACH, Ball, Shaft, Suspects, ball_around
from tracer.shapes import Mesh
from tracer.shapes.sphere import SphereSlot
from tracer.shapes.triangles import MeshData, place_mesh

Array = np.ndarray
PRECISIONS = ["single", "double"]
OWN, OTHER = 5, 7
"""Primitives: the sphere that is asked, and another one."""


def log_uniform(rng: np.random.Generator, low: float, high: float, n: int) -> Array:
    """Numbers from 10^low to 10^high."""
    return 10.0 ** rng.uniform(low, high, n)


def numbers(backend: Backend, values: Array) -> Any:
    return backend.Float(np.ascontiguousarray(values, backend.dtype))


def vectors(backend: Backend, values: Array) -> Any:
    return backend.Vector3(*(numbers(backend, column) for column in values.T))


def rounded(backend: Backend, values: Array) -> Array:
    return np.asarray(values, backend.dtype).astype(np.float64)


# ---- Spheres -----------------------------------------------------------------------------------------------


@dataclass
class Balls:
    """n points `p`, lights (`c`, `light` radius), spheres (`b`, `r`), as the kernel sees them, in double
    precision."""

    p: Array
    c: Array
    light: Array
    b: Array
    r: Array


def away(p: Array, direction: Array, distance: Array) -> Array:
    return p + direction * distance[:, None]


def random_balls(rng: np.random.Generator, n: int) -> Balls:
    """Sizes and distances over decades, near and far from the origin, overlapping or not."""
    scale = log_uniform(rng, -3, 4, n)
    p = directions(rng, n) * (scale * log_uniform(rng, -3, 1, n) * rng.integers(2, size=n))[:, None]
    d, q = (scale * log_uniform(rng, -2, 1, n) for _ in range(2))
    c = away(p, directions(rng, n), d)
    near = directions(rng, n) * log_uniform(rng, -4, 0.3, n)[:, None]
    b = away(p, unit(np.where(rng.integers(2, size=n)[:, None] > 0, c - p + near * d[:, None], near)), q)
    light = d * log_uniform(rng, -5, 0.3, n) * (rng.random(n) > 0.1)  # a tenth of them are points
    return Balls(p, c, light, b, q * log_uniform(rng, -4, 0.3, n))


def tangent_balls(rng: np.random.Generator, n: int) -> Balls:
    """The sphere touches the cone of the light, from outside or inside, or the point, or the light; all but
    for a small number."""
    balls = random_balls(rng, n)
    d = np.linalg.norm(balls.c - balls.p, axis=1)
    axis = (balls.c - balls.p) / d[:, None]
    across = unit(np.cross(axis, directions(rng, n)))
    little = log_uniform(rng, -9, -1, n) * rng.choice([-1, 1], n)
    q = np.linalg.norm(balls.b - balls.p, axis=1)
    r = q * np.minimum(log_uniform(rng, -4, 0, n), 1 - log_uniform(rng, -8, -0.5, n))
    light = np.minimum(balls.light, d * (1 - log_uniform(rng, -8, -0.5, n)))
    alpha, beta = np.arcsin(light / d), np.arcsin(r / q)
    angle = np.where(rng.integers(2, size=n), beta + alpha, np.abs(beta - alpha)) * (1 + little)
    b = away(balls.p, axis * np.cos(angle)[:, None] + across * np.sin(angle)[:, None], q)
    case = rng.integers(4, size=n)
    touches_point = case == 1
    r = np.where(touches_point, q * (1 + little), r)
    between = np.linalg.norm(balls.c - b, axis=1)
    r = np.where((case == 2) & (between > light), (between - light) * (1 + little), r)
    return Balls(balls.p, balls.c, light, b, np.abs(r))


def inside_balls(rng: np.random.Generator, n: int) -> Balls:
    """Points on the sphere, seen from inside; lights near it, most of them just outside."""
    scale = log_uniform(rng, -3, 4, n)
    r = scale * log_uniform(rng, -1, 2, n)
    shift = directions(rng, n) * (scale * log_uniform(rng, -3, 1, n))[:, None]
    normal = directions(rng, n)
    other = unit(normal + directions(rng, n) * log_uniform(rng, -6, 1, n)[:, None])
    light = r * log_uniform(rng, -6, 0, n) * (rng.random(n) > 0.5)
    gap = r * log_uniform(rng, -17, 1, n)
    p = normal * r[:, None] + shift
    at_origin = rng.integers(2, size=n)[:, None] > 0
    move = np.where(at_origin, p, 0)
    return Balls(p - move, away(shift - move, other, r + light + gap), light, shift - move, r)


@dataclass
class SphereVerdicts:
    """Of n configurations: what the shaft says, and, over all samples of the light, whether `some` and
    `every` shadow ray is blocked, by the tracer's rule and in `exact` arithmetic (some, every)."""

    balls: Balls
    may_meet: Array
    covered: Array
    apart: Array
    some: Array
    every: Array
    exact: tuple[Array, Array]


def light_points(balls: Balls, rng: np.random.Generator, random_points: int) -> list[Array]:
    """Points (n, 3) of the light's balls: those seen nearest to the sphere and farthest from it, the nearest
    and the farthest of all, and random ones."""
    axis, toward = balls.c - balls.p, balls.b - balls.p
    d = np.linalg.norm(axis, axis=1)
    along = axis / np.maximum(d, 1e-300)[:, None]
    across = toward - along * (toward * along).sum(axis=1)[:, None]
    across /= np.maximum(np.linalg.norm(across, axis=1), 1e-300)[:, None]
    sin = np.minimum(balls.light / np.maximum(d, 1e-300), 1)[:, None]
    cos = np.sqrt(1 - sin**2)
    rim = [s * cos * across - sin * along for s in (1, -1)]  # where tangents from p touch the ball
    normals = [*rim, along, -along, across, -across, unit(balls.b - balls.c), unit(balls.c - balls.b)]
    normals += [directions(rng, len(d)) for _ in range(random_points)]
    return [balls.c + normal * balls.light[:, None] for normal in normals]


def ask_spheres(precision: str, balls: Balls, word: int, points: int, seed: int) -> SphereVerdicts:
    """`word`: what the shadow rays leave."""
    backend = find_backend("llvm", precision)
    n, dtype = len(balls.p), np.longdouble
    balls = Balls(*(rounded(backend, getattr(balls, name)) for name in ("p", "c", "light", "b", "r")))
    extent = np.maximum(np.abs(balls.c).max(axis=1) + balls.light, 0)
    held = balls.light + CONTACT_REACH * backend.epsilon * extent  # as `ball_around` makes it
    with exact_arithmetic():
        center, radius = vectors(backend, balls.b), numbers(backend, balls.r)
        size = np.abs(balls.b).max(axis=1) + balls.r
        margin = numbers(backend, 64 * backend.epsilon * balls.r * size)
        slot = SphereSlot(center, radius, margin, backend.UInt32(OWN))
        p = vectors(backend, balls.p)
        if word >> 1 == OWN:
            p = slot.surface(backend.Vector4(center.x, center.y, center.z, radius), p)[0]
            balls.p = p.numpy().T.astype(np.float64)
        shaft = Shaft.of(backend, p, Ball(vectors(backend, balls.c), numbers(backend, held)))
        found = shaft.toward(center, radius)
        dr.eval(found)
        some, every = np.zeros(n, bool), np.ones(n, bool)
        exact_some, exact_every = np.zeros(n, bool), np.ones(n, bool)
        zero = dr.zeros(backend.UInt32, n)
        for light in light_points(balls, np.random.default_rng(seed), points):
            target = vectors(backend, light)
            way = target - p
            length = dr.sqrt(dr.squared_norm(way))
            ray = Ray(p, way * dr.rcp(length), zero + word, zero, None)
            blocked = slot.blocks(Segment(ray, length, target, zero, zero), True).numpy()
            some, every = some | blocked, every & blocked
            truly = hides(balls, rounded(backend, light), dtype)
            exact_some, exact_every = exact_some | truly, exact_every & truly
    return SphereVerdicts(
        balls,
        found.may_meet.numpy(),
        found.covered.numpy(),
        found.apart.numpy(),
        some,
        every,
        (exact_some, exact_every),
    )


def hides(balls: Balls, light: Array, dtype: Any) -> Array:
    """Whether the sphere's surface lies strictly between p and the light, in the arithmetic of `dtype`."""
    p, b, target = balls.p.astype(dtype), balls.b.astype(dtype), light.astype(dtype)
    r2 = balls.r.astype(dtype) ** 2
    way, to_center = target - p, b - p
    length2 = (way**2).sum(axis=1)
    share = (way * to_center).sum(axis=1) / np.where(length2 > 0, length2, 1)
    closest = ((way * share[:, None] - to_center) ** 2).sum(axis=1)
    outside, beyond = (to_center**2).sum(axis=1) > r2, ((target - b) ** 2).sum(axis=1) > r2
    passes = (closest < r2) & (share > 0) & ((share < 1) | ~beyond)
    return np.where(outside, passes, beyond)


def check_spheres(
    precision: str, make: Callable[[np.random.Generator, int], Balls], n: int, points: int, seed: int = 1
) -> SphereVerdicts:
    found = ask_spheres(precision, make(np.random.default_rng(seed), n), 2 * OTHER, points, seed)
    exact_some, exact_every = found.exact
    for name, wrong in {
        "cleared, yet a shadow ray is blocked": ~found.may_meet & found.some,
        "cleared, yet exactly a way is blocked": ~found.may_meet & exact_some,
        "covered, yet a shadow ray passes": found.covered & ~found.every,
        "covered, yet exactly a way passes": found.covered & ~exact_every,
    }.items():
        report(name, wrong, found.balls)
    return found


def check_inside(precision: str, n: int, points: int, seed: int = 1) -> SphereVerdicts:
    """A sphere hides every light that it is apart from, from points on its inside."""
    found = ask_spheres(precision, inside_balls(np.random.default_rng(seed), n), 2 * OWN + 1, points, seed)
    report("apart, yet a shadow ray passes", found.apart & ~found.every, found.balls)
    return found


def report(name: str, wrong: Array, example: Any) -> None:
    if wrong.any():
        k = int(np.argmax(wrong))
        values = {key: value[k].tolist() for key, value in vars(example).items()}
        pytest.fail(f"{name}: {int(wrong.sum())} of {len(wrong)}, for example {values}")


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("make", [random_balls, tangent_balls])
def test_a_sphere_and_a_light_seen_from_a_point(make: Callable[..., Balls], precision: str) -> None:
    found = check_spheres(precision, make, 20_000, 4)
    assert found.some.mean() > 0.1 and found.every.mean() > 0.05  # there is something to find
    assert (~found.may_meet).mean() > 0.02 and found.covered.mean() > 0.01


@pytest.mark.slow
@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("make", [random_balls, tangent_balls])
def test_many_spheres_and_lights(make: Callable[..., Balls], precision: str) -> None:
    for seed in range(2, 5):
        check_spheres(precision, make, 150_000, 8, seed)


@pytest.mark.parametrize("precision", PRECISIONS)
def test_a_sphere_around_a_point_on_its_inside(precision: str) -> None:
    found = check_inside(precision, 30_000, 2)
    assert found.apart.mean() > 0.5 * found.every.mean() > 0.1


@pytest.mark.parametrize("precision", PRECISIONS)
def test_most_spheres_are_decided_at_once(precision: str) -> None:
    """Of small spheres and lights in a room a single shadow ray is spared for more than nine in ten."""
    rng = np.random.default_rng(3)
    p, c, b = (rng.uniform(-5, 5, (20_000, 3)) for _ in range(3))
    balls = Balls(p, c, np.full(len(p), 0.3), b, np.full(len(p), 0.3))
    found = ask_spheres(precision, balls, 2 * OTHER, 8, 3)
    assert (~found.may_meet).mean() > 0.9
    assert (~found.may_meet)[~found.some].mean() > 0.95
    balls = Balls(
        p, c, np.full(len(p), 0.05), (p + c) / 2 + rng.normal(size=p.shape) * 0.1, np.full(len(p), 1.0)
    )
    found = ask_spheres(precision, balls, 2 * OTHER, 8, 3)
    assert found.every.mean() > 0.5 and found.covered[found.every].mean() > 0.7


@pytest.mark.parametrize("kind", ["ring", "disk", "sphere", "rectangle"])
@pytest.mark.parametrize("jitter", [False, True])
def test_a_light_lies_in_its_ball(kind: str, jitter: bool) -> None:
    table = worlds.FEATURES[f"{kind} jitter" if jitter else f"{kind} light"]()
    scene = compiled(table)
    backend, lights = scene.backend, scene.lights
    rng, n = np.random.default_rng(1), 5000
    i = backend.UInt32(rng.integers(8, size=n).astype(np.uint32))
    shift = backend.Vector2(*(numbers(backend, s) for s in np.round(rng.random((2, n)), 2)))
    nowhere = dr.zeros(backend.UInt32, n)
    sample, _ = fetch_sample(backend, lights, i, shift, lambda p: (nowhere, nowhere))
    ball = fetch_ball(backend, lights, dr.gather(backend.UInt32, lights.lights, i))
    away = np.linalg.norm((sample.position - ball.center).numpy().astype(np.float64), axis=0)
    assert (away <= ball.radius.numpy()).all()


# ---- Triangles ---------------------------------------------------------------------------------------------


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


def ask_triangles(scene: DeviceScene, stand: Stand, lights: Lights) -> BeamVerdicts:
    backend, n = scene.backend, len(stand.p)
    assert scene.triangles is not None
    extent = np.abs(lights.c).max(axis=1) + lights.radius
    held = lights.radius + CONTACT_REACH * backend.epsilon * extent
    ball = Ball(vectors(backend, lights.c), numbers(backend, held))
    surface, valid = stand.surface, backend.Bool(stand.valid)
    shaft = Shaft.of(backend, surface.p, ball)
    verdict = beam.look_along(
        backend, scene.triangles, shaft, surface.lit_side, surface.primitive, valid
    ).numpy()
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
    report("clear, yet a shadow ray is blocked", (found.verdict == beam.CLEAR) & found.some, found.lanes)
    covered = found.verdict == beam.COVERED
    report("covered, yet a shadow ray passes", covered & found.lit & ~found.every, found.lanes)
    assert stand.valid.mean() > 0.7 and found.lit.mean() > 0.2
    return found


STAGES = [soup, solids, smooth_solids, wall_on_floor, slivers_over_plane]


@pytest.mark.parametrize("precision", PRECISIONS)
def test_a_light_behind_triangles(precision: str) -> None:
    found = check_triangles(soup, precision, 10_000, 1)
    assert found.some.mean() > 0.1
    assert (found.verdict == beam.CLEAR)[found.lit & ~found.some].mean() > 0.3
    assert (found.verdict == beam.COVERED)[found.lit & found.every].mean() > 0.2


@pytest.mark.slow
@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("make", STAGES)
def test_many_lights_behind_triangles(make: Callable[..., Any], precision: str) -> None:
    for seed in range(3):
        check_triangles(make, precision, 20_000, seed)


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("name", ["cube", "tetrahedron", "icosphere"])
def test_a_convex_mesh_hides_no_light_from_its_outside(name: str, precision: str) -> None:
    rng = np.random.default_rng(8)
    scene = compiled({"shapes": [moved(solid(name, rng), rng.uniform(-2, 2, 3))]}, precision)
    mesh = scene.host.meshes[0]
    if precision == "single":
        assert is_convex(mesh, scene.backend.epsilon) and scene.enclosures[0].convex
    chosen = mesh.corners[rng.integers(len(mesh.corners), size=10_000)]
    with exact_arithmetic():
        stand = stand_on(scene, inside_of(chosen, rng), rng)
        found = ask_triangles(scene, stand, lights_around(stand, chosen, rng, 3))
    outside = stand.surface.entering.numpy()
    if scene.enclosures[0].convex:
        report("hidden by a convex mesh", found.some & outside, found.lanes)
    assert (found.lit & outside).mean() > 0.1


@pytest.mark.parametrize("change", ["dent", "second", "hollow"])
def test_other_meshes_do_not_pass_for_convex(change: str) -> None:
    rng = np.random.default_rng(4)
    shape = solid("icosphere", rng)
    vertices, faces = np.array(shape["vertices"]), np.array(shape["faces"])
    if change == "dent":
        vertices[3] *= 0.8
    elif change == "second":
        vertices, faces = np.concatenate([vertices, vertices + [4, 0, 0]])[:42], faces
        vertices[:3] += [4, 0, 0]
    else:
        faces = faces[:, ::-1]
    table = {"kind": "mesh", "vertices": vertices.tolist(), "faces": faces.tolist()}
    assert not compiled({"shapes": [table]}).enclosures[0].convex


def test_a_far_triangle_does_not_make_a_crease_convex() -> None:
    """A floor and a wall at the origin, and a triangle a million units away: rounding there is none here."""
    far = 1e6
    vertices = [[0, 0, 0], [0.5, 0, 0], [0, 0, -0.5], [0, 0.5, 0]]
    vertices += [[-far, -far, 0], [-far, -far, -far], [1e5 - far, -far - 1e5, 0]]
    for faces in ([[0, 1, 2], [0, 2, 3], [4, 5, 6]], [[0, 2, 1], [0, 3, 2], [4, 6, 5]]):
        mesh = {"kind": "mesh", "vertices": vertices, "faces": faces}
        assert not compiled({"shapes": [mesh]}).enclosures[0].convex


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
        triangle = Triangle(a, b, c, vectors(backend, normals))
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


@pytest.mark.slow
@pytest.mark.parametrize("precision", PRECISIONS)
def test_many_slivers_and_lights_and_points_inside(precision: str) -> None:
    for seed in range(2, 5):
        check_lone(precision, 200_000, 4, seed)
        check_inside(precision, 200_000, 2, seed)


@pytest.mark.parametrize("precision", PRECISIONS)
def test_a_sliver_and_a_light(precision: str) -> None:
    check_lone(precision, 80_000, 4)


# ---- Whole pictures ----------------------------------------------------------------------------------------


def everybody(scene: DeviceScene, surface: Surface, *_: Any, **__: Any) -> Suspects:
    return Suspects.everybody(scene.backend, dr.width(surface.p))


def check_picture(table: dict[str, Any], folder: Any, precision: str, patch: pytest.MonkeyPatch) -> None:
    """The same bytes as with a shadow ray for every sample and shape."""
    scene = tracer.load(table, base_dir=folder)
    spared = tracer.render(scene, precision=precision)
    with patch.context() as plain:
        plain.setattr(direct_light, "find_suspects", everybody)
        asked = tracer.render(scene, precision=precision)
    assert spared.color.tobytes() == asked.color.tobytes()


def ring_of_spheres() -> worlds.Table:
    """Many spheres, meshes and an area light between them."""
    table = worlds.FEATURES["many spheres"]()
    light = {"kind": "sphere", "center": [0.3, 3.1, 2.2], "radius": 0.7, "samples": 6, "weight": 3.0}
    return table | {"lights": [*worlds.POINT_LIGHTS, light]}


def beside_meshes() -> worlds.Table:
    """A light that jitters low over smooth meshes, one of them transparent."""
    table = worlds.FEATURES["smooth glass"]()
    light = {"kind": "disk", "center": [-0.7, 2.9, 3.1], "normal": [0.2, -1, 0], "radius": 1.9, "samples": 5}
    return table | {"lights": [worlds.POINT_LIGHTS[0], light | {"jitter": True}]}


PICTURES: dict[str, Callable[[], worlds.Table]] = {
    "spheres": ring_of_spheres,
    "meshes": beside_meshes,
    **{
        name: worlds.FEATURES[name]
        for name in (
            "sphere light",
            "rectangle jitter",
            "transparent shadows",
            "many transparent",
            "flat meshes",
        )
    },
    **{f"random {seed}": partial(worlds.random_scene, seed) for seed in range(4)},
}
QUICK = ("sphere light", "meshes")


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in PICTURES]
)
def test_a_picture_in_single_precision(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check_picture(PICTURES[name](), worlds.write_files(tmp_path), "single", monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_in_double_precision(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check_picture(PICTURES[name](), worlds.write_files(tmp_path), "double", monkeypatch)


# ---- Planted errors ----------------------------------------------------------------------------------------


def rewrite(patch: pytest.MonkeyPatch, owner: Any, name: str, old: str, new: str) -> None:
    """Replaces a function by itself with another text at one place."""
    function = inspect.unwrap(getattr(owner, name))
    source = textwrap.dedent(inspect.getsource(function))
    assert source.count(old) == 1, f"{name}: {source.count(old)} times {old!r}"
    place: dict[str, Any] = {}
    exec(source.replace(old, new), function.__globals__, place)
    patch.setattr(owner, name, place[name])


def narrow_blocker_covers(patch: pytest.MonkeyPatch) -> None:
    rewrite(patch, Shaft, "toward", "wider & (along", "(along")


def light_too_small(patch: pytest.MonkeyPatch) -> None:
    of = Shaft.of
    patch.setattr(
        Shaft,
        "of",
        staticmethod(lambda backend, p, ball: of(backend, p, Ball(ball.center, 0.99 * ball.radius))),
    )


def light_in_front_covered(patch: pytest.MonkeyPatch) -> None:
    rewrite(patch, Shaft, "toward", "inside_cone & beyond & apart", "inside_cone & apart")


def overlapping_counts_as_apart(patch: pytest.MonkeyPatch) -> None:
    rewrite(patch, Shaft, "toward", "apart = gap > 4 *", "apart = gap > -4e6 *")


def margin_of_lights_forgotten(patch: pytest.MonkeyPatch) -> None:
    rewrite(patch, Shaft, "toward", "4 * dr.fma(epsilon * CONTACT_REACH, size, self.slack)", "4 * slack")


def faces_not_turned(patch: pytest.MonkeyPatch) -> None:
    rewrite(patch, beam, "_meet", "dr.select(before, backend.Float(-1), 1)", "backend.Float(1)")


def faces_turned_by_noise(patch: pytest.MonkeyPatch) -> None:
    rewrite(patch, beam, "_meet", "dr.select(before,", "dr.select(dr.dot(faces[0], a) < 0,")


def slabs_for_a_ray(patch: pytest.MonkeyPatch) -> None:
    of = beam._Slabs.of

    def thin(backend: Backend, tables: Any, shaft: Shaft) -> Any:
        return of(backend, tables, replace(shaft, radius=shaft.radius * 0))

    patch.setattr(beam._Slabs, "of", staticmethod(thin))


def ball_of_the_light_too_small(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(light_tables, "ball_around", lambda points, e: ball_around(points, e) * [1, 1, 1, 0.99])


def spheres_check() -> None:
    for make in (random_balls, tangent_balls):
        check_spheres("single", make, 20_000, 4)


def inside_check() -> None:
    check_inside("single", 30_000, 2)


def sliver_check() -> None:
    check_lone("single", 80_000, 4)


def soup_check() -> None:
    check_triangles(soup, "single", 10_000, 1)


def ball_check() -> None:
    test_a_light_lies_in_its_ball("ring", False)


@pytest.mark.parametrize(
    ("plant", "check"),
    [
        (narrow_blocker_covers, spheres_check),
        (light_too_small, spheres_check),
        (light_too_small, soup_check),
        (light_in_front_covered, spheres_check),
        (overlapping_counts_as_apart, inside_check),
        (margin_of_lights_forgotten, inside_check),
        (faces_not_turned, sliver_check),
        (faces_not_turned, soup_check),
        (faces_turned_by_noise, sliver_check),
        (slabs_for_a_ray, soup_check),
        (ball_of_the_light_too_small, ball_check),
    ],
)
def test_planted_error_is_caught(
    plant: Callable[[pytest.MonkeyPatch], None],
    check: Callable[[], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plant(monkeypatch)
    with pytest.raises((AssertionError, pytest.fail.Exception)):
        check()
