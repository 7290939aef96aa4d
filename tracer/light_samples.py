"""Area lights as sets of point lights (document, section 4): the samples' places, plain and jittered.

Every sample is one row: position = base + alpha A + beta B, where the light's shape gives the vectors A and B
and two numbers on the sample. Without jitter the position is computed once, in double precision; with jitter
in the kernel.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import drjit as dr
import numpy as np

from tracer.backends import Backend
from tracer.lights import DiskLight, LightRecord, PointLight, RectangleLight, RingLight, SphereLight
from tracer.random import JITTER_STREAM, fraction, philox

GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))
GOLDEN_RATIO = (math.sqrt(5) - 1) / 2

POINT, RING, DISK, SPHERE, RECTANGLE = range(5)

UNROLLED_SAMPLES = 4
"""Up to so many samples stand in the kernel one by one; more are looped over."""

ROW = 16
"""Floats of a sample: base (3), A (3), first, B (3), second, color times share of the light (3), and 2
unused."""


@dataclass
class SamplePattern:
    """The samples of one light. `first`, `second`: (n,) numbers that the kind turns into alpha and beta."""

    kind: int
    base: np.ndarray
    a: np.ndarray
    b: np.ndarray
    first: np.ndarray = field(default_factory=lambda: np.zeros(1))
    second: np.ndarray = field(default_factory=lambda: np.zeros(1))


def pattern(light: LightRecord) -> SamplePattern:
    """The samples of a light, as the document's section 4 places them."""
    zero = np.zeros(3)
    if isinstance(light, PointLight):
        return SamplePattern(POINT, np.array([light.position]), zero, zero)
    assert isinstance(light, (RingLight, DiskLight, SphereLight, RectangleLight))
    n = light.samples
    k = np.arange(n)
    fractions, angles = (k + 0.5) / n, np.mod(k * GOLDEN_ANGLE, 2 * math.pi)
    center = np.tile(np.asarray(light.center, np.float64), (n, 1))
    if isinstance(light, SphereLight):
        q = 1 - 2 * fractions
        center[:, 1] += light.radius * q
        x, z = np.array([light.radius, 0.0, 0.0]), np.array([0.0, 0.0, light.radius])
        return SamplePattern(SPHERE, center, x, z, np.sqrt(1 - q * q), angles)
    u, v = frame(np.asarray(light.normal, np.float64))
    if isinstance(light, RectangleLight):
        width, height = light.size
        return SamplePattern(
            RECTANGLE, center, width * u, height * v, fractions, np.mod((k + 0.5) * GOLDEN_RATIO, 1)
        )
    if isinstance(light, RingLight):
        return SamplePattern(
            RING, center, light.radius * u, light.radius * v, np.ones(n), 2 * math.pi * fractions
        )
    return SamplePattern(DISK, center, light.radius * u, light.radius * v, fractions, angles)


def frame(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """u = unit(up x normal), v = normal x u, with up = y, or z for a normal within 1e-6 of the y axis."""
    normal = normal / np.linalg.norm(normal)
    along_y = np.hypot(normal[0], normal[2]) <= 1e-6
    up = np.array([0.0, 0.0, 1.0]) if along_y else np.array([0.0, 1.0, 0.0])
    u = np.cross(up, normal)
    u /= np.linalg.norm(u)
    return u, np.cross(normal, u)


@dataclass
class LightSample:
    """One point light of a kernel: `position` (3, n), `color` times share (3, n), bits for the planes."""

    position: Any
    color: Any
    sides: Any
    decided: Any


@dataclass
class LightTables:
    """All light samples in Dr.Jit memory.

    `rows`: `ROW` floats a sample (without jitter `base` is the position); `kinds`, `lights`: its kind and the
    number of its light; `sides`, `decided`: its bits for the planes; `count`: width-1; `jitter`: some light
    has it; `samples`: all of them as width-1 numbers, when they are few and none jitters.
    """

    rows: Any
    kinds: Any
    lights: Any
    sides: Any
    decided: Any
    count: Any
    seed: Any
    jitter: bool
    samples: list[LightSample] | None


def compile_lights(
    backend: Backend, lights: Sequence[LightRecord], colors: np.ndarray, planes: np.ndarray, seed: int
) -> LightTables:
    """Tables of the samples of all lights whose weight is not zero.

    `colors` (lights, 3): in the color space of the shading; `planes` (p, 4): n and d of the planes that have
    bits.
    """
    total = math.fsum(light.weight for light in lights)
    rows, kinds, numbers = [], [], []
    for number, light in enumerate(lights):
        if light.weight == 0:
            continue
        samples = pattern(light)
        jitter = getattr(light, "jitter", False)
        share = light.weight / total / len(samples.base)
        alpha, beta = _coordinates(samples)
        block = np.zeros((len(samples.base), ROW))
        block[:, 0:3] = samples.base
        if jitter:
            block[:, 3:6], block[:, 7:10] = samples.a, samples.b
        else:
            block[:, 0:3] += alpha[:, None] * samples.a + beta[:, None] * samples.b
        block[:, 6], block[:, 10] = samples.first, samples.second
        block[:, 11:14] = share * colors[number]
        rows.append(block)
        kinds.append(np.full(len(block), samples.kind if jitter else POINT))
        numbers.append(np.full(len(block), number))
    table = np.concatenate(rows) if rows else np.zeros((1, ROW))
    sides, decided = _plane_bits(table[:, :3], planes, backend)
    count = sum(len(block) for block in rows)
    jitters = any(getattr(light, "jitter", False) for light in lights)
    unrolled = None
    if count <= UNROLLED_SAMPLES and not jitters:
        unrolled = [
            LightSample(
                position=backend.opaque_vector(table[i, :3]),
                color=backend.opaque_vector(table[i, 11:14]),
                sides=backend.opaque_id(sides[i]),
                decided=backend.opaque_id(decided[i]),
            )
            for i in range(count)
        ]
    return LightTables(
        rows=backend.table(table),
        kinds=backend.id_table(np.concatenate(kinds) if kinds else [0]),
        lights=backend.id_table(np.concatenate(numbers) if numbers else [0]),
        sides=backend.id_table(sides),
        decided=backend.id_table(decided),
        count=backend.opaque_id(count),
        seed=backend.opaque_id(seed & 0xFFFFFFFF),
        jitter=jitters,
        samples=unrolled,
    )


def _coordinates(samples: SamplePattern) -> tuple[np.ndarray, np.ndarray]:
    """alpha and beta of every sample, without jitter."""
    first, second = samples.first, samples.second
    if samples.kind == RECTANGLE:
        return first - 0.5, second - 0.5
    radius = np.sqrt(first) if samples.kind == DISK else first
    return radius * np.cos(second), radius * np.sin(second)


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


def fetch_light(
    backend: Backend, tables: LightTables, i: Any, pixel: Any, sub_ray: Any, plane_sides: Any
) -> LightSample:
    """Sample i of the table; `plane_sides(point)` gives the bits of a jittered position."""
    a, b, c, d = (dr.gather(backend.Vector4, tables.rows, i * 4 + k) for k in range(4))
    vector = backend.Vector3
    position = vector(a.x, a.y, a.z)
    sides = dr.gather(backend.UInt32, tables.sides, i)
    decided = dr.gather(backend.UInt32, tables.decided, i)
    color = vector(c.w, d.x, d.y)
    if tables.jitter:
        kind = dr.gather(backend.UInt32, tables.kinds, i)
        shift = _jitter(backend, tables, i, pixel, sub_ray)
        alpha, beta = _jittered_coordinates(kind, b.z, c.z, *shift)
        position = position + alpha * vector(a.w, b.x, b.y) + beta * vector(b.w, c.x, c.y)
        moved = plane_sides(position)
        sides = dr.select(kind == POINT, sides, moved[0])
        decided = dr.select(kind == POINT, decided, moved[1])
    return LightSample(position, color, sides, decided)


def _jitter(backend: Backend, tables: LightTables, i: Any, pixel: Any, sub_ray: Any) -> tuple[Any, Any]:
    """The two shifts in [0, 1) of a light's pattern: the same for all its samples and all hits of a
    sub-ray."""
    light = dr.gather(backend.UInt32, tables.lights, i)
    key = (tables.seed, backend.UInt32(JITTER_STREAM))
    words = philox(key, (pixel, sub_ray, light, backend.UInt32(0)))
    return fraction(backend.Float, words[0]), fraction(backend.Float, words[1])


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
