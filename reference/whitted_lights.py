"""Light that arrives on straight ways, for `reference.whitted` (document, sections 2 and 4)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from reference import plain
from reference.whitted_tables import owned_table, xyz
from reference.whitted_types import Array3f, Array4f, Bool, Float, UInt32, dr

PHILOX_ROUNDS = 10


@dataclass(frozen=True)
class Light:
    """One light in memory.

    `samples`: a row a sample, its position, or its constants under jitter, see `sample_constants`; `share` of
    one sample; `center`, `u`, `v` scaled to the light's size. `kind`, `count`, `jitter` and `white` are part
    of the kernel.
    """

    samples: Float
    share: Float
    color: Array3f
    center: Array3f
    u: Array3f
    v: Array3f
    kind: str
    number: int
    count: int
    jitter: bool
    white: bool


@dataclass
class Jitter:
    """How one light's pattern is shifted for each lane: two fractions, cosine and sine of the turn."""

    u0: Float
    u1: Float
    cos: Float
    sin: Float


def read_lights(world: plain.World) -> list[Light]:
    """The lights with a weight; others add nothing and cast no shadow rays."""
    return [read_light(light, number) for number, light in enumerate(world.lights) if light.share > 0]


def read_light(light: plain.Light, number: int) -> Light:
    """One light, its pattern worked out in double precision."""
    if light.jitter:
        table = np.array([sample_constants(light, k) for k in range(light.samples)])
    else:
        points = np.array([light.point(k, 0.0, 0.0) for k in range(light.samples)])
        table = np.column_stack([points, np.zeros(len(points))])
    sizes = light.size if light.kind == "rectangle" else (light.radius, light.radius)
    u, v = (light.u, light.v) if light.kind != "sphere" else (plain.Vec(1, 0, 0), plain.Vec(0, 0, 1))
    return Light(
        samples=owned_table(table),
        share=dr.opaque(Float, light.share / light.samples),
        color=opaque_vector(light.color),
        center=opaque_vector(light.center),
        u=opaque_vector(sizes[0] * u),
        v=opaque_vector(sizes[1] * v),
        kind=light.kind,
        number=number,
        count=light.samples,
        jitter=light.jitter,
        white=light.color == plain.WHITE,
    )


def sample_constants(light: plain.Light, k: int) -> tuple[float, float, float, float]:
    """What jitter shifts: the place on the unit circle and a number beside it, or a rectangle's fractions."""
    fraction = (k + 0.5) / light.samples
    if light.kind == "rectangle":
        return fraction, (k + 0.5) * plain.GOLDEN_FRACTION % 1, 0.0, 0.0
    angle = 2 * math.pi * fraction if light.kind == "ring" else k * plain.GOLDEN_ANGLE
    height = 1 - 2 * fraction if light.kind == "sphere" else 0.0
    rho = math.sqrt(1 - height**2)
    return rho * math.cos(angle), rho * math.sin(angle), fraction, height * light.radius


def opaque_vector(values: Any) -> Array3f:
    """Three numbers that kernels read as data: other numbers need no other kernel."""
    return Array3f(*(dr.opaque(Float, float(x)) for x in values))


def jitter_of(light: Light, seed: UInt32, pixel: UInt32, sub_ray: UInt32) -> Jitter | None:
    """The shift of a light's pattern for each lane; None for one that stands still."""
    if not light.jitter:
        return None
    words = philox([pixel, sub_ray, UInt32(light.number), UInt32(0)], seed, plain.LIGHT_JITTER_STREAM)
    u0, u1 = (Float(word >> 8) * 2.0**-24 for word in words[:2])
    sin, cos = dr.sincos(2 * dr.pi * u0)
    return Jitter(u0, u1, cos, sin)


def philox(counter: Sequence[UInt32], seed: UInt32, stream: int) -> list[UInt32]:
    """Philox-4x32-10 (document, section 10)."""
    (c0, c1, c2, c3), k0, k1 = counter, seed, UInt32(stream)
    a, b = UInt32(0xD2511F53), UInt32(0xCD9E8D57)
    for _ in range(PHILOX_ROUNDS):
        high_a, high_b = UInt32(dr.mul_hi(a, c0)), UInt32(dr.mul_hi(b, c2))
        c0, c1, c2, c3 = high_b ^ c1 ^ k0, b * c2, high_a ^ c3 ^ k1, a * c0
        k0, k1 = k0 + 0x9E3779B9, k1 + 0xBB67AE85
    return [c0, c1, c2, c3]


def sample_position(light: Light, jitter: Jitter | None, k: UInt32, active: Bool) -> Array3f:
    """Where sample k of a light is for each lane (document, section 4)."""
    row = dr.gather(Array4f, light.samples, k, active)
    if jitter is None:
        return xyz(row)
    if light.kind == "rectangle":
        across, along = wrapped(row.x + jitter.u0) - 0.5, wrapped(row.y + jitter.u1) - 0.5
        return light.center + across * light.u + along * light.v
    x, y = row.x * jitter.cos - row.y * jitter.sin, row.y * jitter.cos + row.x * jitter.sin
    if light.kind == "disk":
        reach = dr.sqrt(wrapped(row.z + jitter.u1))
        x, y = reach * x, reach * y
    return light.center + x * light.u + y * light.v + Array3f(0, row.w, 0)


def wrapped(x: Float) -> Float:
    """x mod 1 for x in [0, 2)."""
    return dr.select(x >= 1, x - 1, x)
