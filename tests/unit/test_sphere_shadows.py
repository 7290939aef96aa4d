"""The quick question that shadow rays ask a sphere first never hides what the exact one finds."""

from __future__ import annotations

import drjit as dr
import numpy as np
import pytest

from tests.accuracy.probe import directions
from tracer.backends import INVALID, exact_arithmetic, find_backend
from tracer.ray import Ray, Segment, departure_word
from tracer.shapes.sphere import Sphere, SphereSlot

Array = np.ndarray
WAYS = 20_000
CASES = 60


def masks(precision: str, seed: int, slack: float = 1.0) -> tuple[Array, Array]:
    """Whether a sphere may block and does block ways from points everywhere (within it, on it, on a ball that
    touches it, far from it) to a light: past its rim by some roundings, through it, and anywhere."""
    rng = np.random.default_rng(seed)
    backend = find_backend("llvm", precision)
    radius, size = 10 ** rng.uniform(-3, 3, 2)
    center = size * rng.normal(size=3)
    row = np.array([*center, radius]).astype(np.float32).astype(np.float64)
    center, radius = row[:3], row[3]
    light = center + radius * 10 ** rng.uniform(-1, 3) * directions(rng, 1)[0]
    light = light.astype(np.float32).astype(np.float64)
    # Points on lines from the light that pass the center at this many radii.
    aim = directions(rng, WAYS)
    rim = rng.choice([0.0, 0.5, 1.0, 2.0], WAYS) + 10 ** rng.uniform(-9, -2, WAYS) * rng.choice([-1, 1], WAYS)
    aim -= (
        np.sum(aim * (center - light), axis=1, keepdims=True)
        * (center - light)
        / np.sum((center - light) ** 2)
    )
    aim *= rim[:, None] / np.linalg.norm(aim, axis=1, keepdims=True)
    points = light + (center + radius * aim - light) * 10 ** rng.uniform(-1, 2, (WAYS, 1))
    on_it = rng.uniform(size=WAYS) < 0.3
    rounded = 1 + 8 * backend.epsilon * rng.choice([0, 1, -1], (int(on_it.sum()), 1))
    points[on_it] = center + radius * rounded * directions(rng, int(on_it.sum()))
    own = on_it & (rng.uniform(size=WAYS) < 0.5)
    with exact_arithmetic():
        slot: SphereSlot = Sphere.slot(backend, row, 0, 0)
        p = backend.Vector3(*map(backend.table, points.T))
        target = backend.opaque_vector(light)
        way = target - p
        length = dr.sqrt(dr.squared_norm(way))
        inside = backend.Bool(rng.uniform(size=WAYS) < 0.5)
        leaves = dr.select(backend.Bool(own), departure_word(backend.UInt32(0), inside), INVALID)
        ray = Ray(p, way * dr.rcp(length), leaves, dr.zeros(backend.UInt32, WAYS), None)
        none = dr.zeros(backend.UInt32, WAYS)
        segment = Segment(ray, length, target, none, none)
        return slot.may_block(segment, backend.epsilon * slack).numpy(), slot.blocks(segment, True).numpy()


@pytest.mark.parametrize("precision", ["single", "double"])
def test_what_blocks_may_block(precision: str) -> None:
    told, blocked = 0, 0
    for seed in range(CASES):
        may, does = masks(precision, seed)
        assert not (does & ~may).any(), f"seed {seed}: {int((does & ~may).sum())}"
        told, blocked = told + int((~may).sum()), blocked + int(does.sum())
    assert told > 0.05 * CASES * WAYS and blocked > 0.2 * CASES * WAYS


def test_a_cone_that_is_too_narrow_is_caught() -> None:
    narrow = [masks("single", seed, slack=-1.0) for seed in range(CASES)]
    assert any((does & ~may).any() for may, does in narrow)
