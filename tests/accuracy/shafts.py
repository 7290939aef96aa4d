"""Points, lights and spheres drawn at random, many of them within rounding of being tangent, and each verdict
on a whole light held against the shadow rays to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
import pytest

from tests.accuracy.probe import directions, unit
from tracer.backends import Backend, exact_arithmetic, find_backend
from tracer.ray import Ray, Segment
from tracer.shafts import CONTACT_REACH, Ball, Shaft
from tracer.shapes.sphere import SphereSlot

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


def report(name: str, wrong: Array, example: Any) -> None:
    if wrong.any():
        k = int(np.argmax(wrong))
        values = {key: value[k].tolist() for key, value in vars(example).items()}
        pytest.fail(f"{name}: {int(wrong.sum())} of {len(wrong)}, for example {values}")


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
