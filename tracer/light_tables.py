"""The light samples of a scene in Dr.Jit memory: one by one for few, as a table for many or jittered ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from tracer.backends import Backend
from tracer.light_samples import DISK, POINT, RECTANGLE, SamplePattern, coordinates, pattern
from tracer.lights import LightRecord
from tracer.random import JITTER_STREAM, fraction, philox
from tracer.shafts import Ball, ball_around

UNROLLED = 32
"""So many samples of all lights stand in the kernel one by one; more are looped over, which takes twice as
long. One bit a sample must fit a word; 32 lights take a second to compile."""

ROW = 16
"""Floats of a sample: base (3), A (3), first, B (3), second, color times share of the light (3), its part of
the light (1/n), and 1 unused."""


@dataclass
class LightSample:
    """One point light of a kernel: `position` (3, n), and its bits for the planes (see `Segment`)."""

    position: Any
    sides: Any
    decided: Any


@dataclass
class UnrolledLight:
    """A light that stands in the kernel: its `number`, `color` times the share of each of its `samples`, the
    `ball` that holds them, and the number of the `first` one among all."""

    number: int
    color: Any
    ball: Ball
    samples: list[LightSample]
    first: int


@dataclass
class LightTables:
    """All light samples in Dr.Jit memory.

    `rows`: `ROW` floats a sample (without jitter `base` is the position); `kinds`, `lights`: its kind and the
    number of its light; `sides`, `decided`: its bits for the planes; `balls`: 4 floats a light, the ball that
    holds its samples; `count`: width-1; `jitter`, `areas`: some light has jitter, several samples;
    `unrolled`: all lights one by one, when they are few and none jitters.
    """

    rows: Any
    kinds: Any
    lights: Any
    sides: Any
    decided: Any
    balls: Any
    count: Any
    seed: Any
    jitter: bool
    areas: bool
    unrolled: list[UnrolledLight] | None

    @property
    def number(self) -> int:
        """How many lights there are, those without weight too; 1 for none."""
        return len(self.balls) // 4


NOTHING_LIT = np.array([0, 0, 0, -np.inf])
"""In place of the ball around a light without weight: no surface faces it."""


def compile_lights(
    backend: Backend,
    lights: Sequence[LightRecord],
    colors: np.ndarray,
    planes: np.ndarray,
    seed: int,
    animated: bool = False,
) -> LightTables:
    """Tables of the samples of all lights whose weight is not zero.

    `colors` (lights, 3): in the color space of the shading; `planes` (p, 4): n and d of the planes that have
    bits; `animated`: where lights stand in the kernel, those without weight do, too, since in another frame
    they may have one.
    """
    total = math.fsum(light.weight for light in lights)
    sizes = [getattr(light, "samples", 1) for light in lights]
    jitters = any(getattr(light, "jitter", False) for light in lights)
    keeps_all = animated and not jitters and sum(sizes) <= UNROLLED
    blocks, kinds, numbers = [], [], []
    balls = np.zeros((max(1, len(lights)), 4))
    for number, light in enumerate(lights):
        if light.weight == 0 and not keeps_all:
            continue
        samples = pattern(light)
        jitter = bool(getattr(light, "jitter", False))
        block = _rows(samples, jitter)
        block[:, 11:14] = light.weight / total / len(block) * colors[number]
        block[:, 14] = 1 / len(block)
        balls[number] = ball_around(_reached(block), backend.epsilon) if light.weight else NOTHING_LIT
        blocks.append(block)
        kinds.append(np.full(len(block), samples.kind if jitter else POINT))
        numbers.append(np.full(len(block), number))
    table = np.concatenate(blocks) if blocks else np.zeros((1, ROW))
    owners = np.concatenate(numbers) if numbers else np.zeros(1, np.int64)
    sides, decided = _plane_bits(table[:, :3], planes, backend)
    count = sum(map(len, blocks))
    few = count <= UNROLLED and not jitters
    return LightTables(
        rows=backend.table(table),
        kinds=backend.id_table(np.concatenate(kinds) if kinds else [0]),
        lights=backend.id_table(owners),
        sides=backend.id_table(sides),
        decided=backend.id_table(decided),
        balls=backend.table(balls),
        count=backend.opaque_id(count),
        seed=backend.opaque_id(seed & 0xFFFFFFFF),
        jitter=jitters,
        areas=any(size > 1 for size in sizes),
        unrolled=_unrolled(backend, table[:count], owners, balls, sides, decided) if few else None,
    )


def _rows(samples: SamplePattern, jitter: bool) -> np.ndarray:
    """(n, ROW) without colors; unless the light jitters, A and B are added up here, in double precision."""
    rows = np.zeros((len(samples.base), ROW))
    rows[:, 0:3] = samples.base
    if jitter:
        rows[:, 3:6], rows[:, 7:10] = samples.a, samples.b
    else:
        alpha, beta = coordinates(samples)
        rows[:, 0:3] += alpha[:, None] * samples.a + beta[:, None] * samples.b
    rows[:, 6], rows[:, 10] = samples.first, samples.second
    return rows


def _reached(rows: np.ndarray) -> np.ndarray:
    """Points whose hull holds all samples of a light, jittered ones too: |alpha| and |beta| are 1 at most."""
    base, a, b = rows[:, 0:3], rows[:, 3:6], rows[:, 7:10]
    return np.concatenate([base + a + b, base + a - b, base - a + b, base - a - b])


def _plane_bits(points: np.ndarray, planes: np.ndarray, backend: Backend) -> tuple[np.ndarray, np.ndarray]:
    """Bits "on the positive side" and "not on the plane" of points (n, 3), in double precision.

    A light within the rounding of its position (8 eps S) counts as on the plane, which then does not hide it.
    """
    bits = np.left_shift(np.uint32(1), np.arange(len(planes), dtype=np.uint32))
    distance = points @ planes[:, :3].T + planes[:, 3]
    extent = np.maximum(np.abs(points).max(axis=1)[:, None], np.abs(planes[:, 3]))
    sides = np.where(distance > 0, bits, 0).sum(axis=1)
    decided = np.where(np.abs(distance) > 8 * backend.epsilon * extent, bits, 0).sum(axis=1)
    return sides.astype(np.uint32), decided.astype(np.uint32)


def _unrolled(
    backend: Backend,
    rows: np.ndarray,
    owners: np.ndarray,
    balls: np.ndarray,
    sides: np.ndarray,
    decided: np.ndarray,
) -> list[UnrolledLight]:
    result = []
    for number in dict.fromkeys(owners[: len(rows)]):
        own = np.flatnonzero(owners == number)
        samples = [
            LightSample(
                position=backend.opaque_vector(rows[i, :3]),
                sides=backend.opaque_id(sides[i]),
                decided=backend.opaque_id(decided[i]),
            )
            for i in own
        ]
        color = backend.opaque_vector(rows[own[0], 11:14])
        ball = Ball.of(backend, balls[number])
        result.append(UnrolledLight(int(number), color, ball, samples, int(own[0])))
    return result


def fetch_position(backend: Backend, tables: LightTables, i: Any) -> Any:
    """Where sample i of lights without jitter is (3, n)."""
    row = dr.gather(backend.Vector4, tables.rows, i * (ROW // 4))
    return backend.Vector3(row.x, row.y, row.z)


def fetch_ball(backend: Backend, tables: LightTables, light: Any) -> Ball:
    """The balls of lights by number."""
    row = dr.gather(backend.Vector4, tables.balls, light)
    return Ball(backend.Vector3(row.x, row.y, row.z), row.w)


def fetch_sample(
    backend: Backend, tables: LightTables, i: Any, shift: Any, plane_sides: Callable[[Any], tuple[Any, Any]]
) -> tuple[LightSample, Any, Any]:
    """Sample i of the table, its color, its part of the light; `shift` (2, n) jitters it, and then
    `plane_sides(point)` gives its bits."""
    a, b, c, d = (dr.gather(backend.Vector4, tables.rows, i * (ROW // 4) + k) for k in range(ROW // 4))
    vector = backend.Vector3
    position = vector(a.x, a.y, a.z)
    sides = dr.gather(backend.UInt32, tables.sides, i)
    decided = dr.gather(backend.UInt32, tables.decided, i)
    if tables.jitter:
        kind = dr.gather(backend.UInt32, tables.kinds, i)
        alpha, beta = _jittered_coordinates(kind, b.z, c.z, shift.x, shift.y)
        position = position + alpha * vector(a.w, b.x, b.y) + beta * vector(b.w, c.x, c.y)
        moved = plane_sides(position)
        sides = dr.select(kind == POINT, sides, moved[0])
        decided = dr.select(kind == POINT, decided, moved[1])
    return LightSample(position, sides, decided), vector(c.w, d.x, d.y), d.z


def jitter_shift(backend: Backend, tables: LightTables, light: Any, pixel: Any, sub_ray: Any) -> Any:
    """The two shifts in [0, 1) of a light's pattern (2, n): the same for all its samples and all hits of a
    sub-ray."""
    key = (tables.seed, backend.UInt32(JITTER_STREAM))
    words = philox(key, (pixel, sub_ray, light, backend.UInt32(0)))
    return backend.Vector2(fraction(backend.Float, words[0]), fraction(backend.Float, words[1]))


def _jittered_coordinates(kind: Any, first: Any, second: Any, shift0: Any, shift1: Any) -> tuple[Any, Any]:
    """alpha and beta with the pattern shifted modulo its domain."""
    is_rectangle, is_disk = kind == RECTANGLE, kind == DISK
    shifted = first + dr.select(is_rectangle, shift0, shift1)
    shifted = dr.select(shifted >= 1, shifted - 1, shifted)
    radius = dr.select(is_disk, dr.sqrt(shifted), first)
    sin, cos = dr.sincos(second + 2 * math.pi * shift0)
    other = second + shift1
    other = dr.select(other >= 1, other - 1, other)
    alpha = dr.select(is_rectangle, shifted - 0.5, radius * cos)
    return alpha, dr.select(is_rectangle, other - 0.5, radius * sin)
