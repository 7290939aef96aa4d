"""Area lights as sets of point lights (document, section 4): the samples' places, plain and jittered.

Every sample is position = base + alpha A + beta B, where the light's shape gives the vectors A and B and two
numbers on the sample. Without jitter the position is computed once, in double precision; with jitter in the
kernel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from tracer.lights import DiskLight, LightRecord, PointLight, RectangleLight, RingLight, SphereLight

GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))
GOLDEN_RATIO = (math.sqrt(5) - 1) / 2

POINT, RING, DISK, SPHERE, RECTANGLE = range(5)


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


def coordinates(samples: SamplePattern) -> tuple[np.ndarray, np.ndarray]:
    """alpha and beta of every sample, without jitter."""
    first, second = samples.first, samples.second
    if samples.kind == RECTANGLE:
        return first - 0.5, second - 0.5
    radius = np.sqrt(first) if samples.kind == DISK else first
    return radius * np.cos(second), radius * np.sin(second)
