"""What spares shadow rays is right about spheres: each verdict on a whole light against the shadow rays."""

from __future__ import annotations

from collections.abc import Callable

import drjit as dr
import numpy as np
import pytest

from tests.accuracy import worlds
from tests.accuracy.probe import compiled
from tests.accuracy.shafts import (
    OTHER,
    PRECISIONS,
    Balls,
    ask_spheres,
    check_inside,
    check_spheres,
    numbers,
    random_balls,
    tangent_balls,
)
from tracer.light_tables import fetch_ball, fetch_sample


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
    sample, _, _ = fetch_sample(backend, lights, i, shift, lambda p: (nowhere, nowhere))
    ball = fetch_ball(backend, lights, dr.gather(backend.UInt32, lights.lights, i))
    away = np.linalg.norm((sample.position - ball.center).numpy().astype(np.float64), axis=0)
    assert (away <= ball.radius.numpy()).all()
