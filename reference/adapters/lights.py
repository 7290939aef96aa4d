"""The lights in Mitsuba's terms: sets of points, one function a kind.

The document's area lights are sets of points that cannot be seen (document, section 4), so a point emitter
for each sample is what comes closest; Mitsuba's area emitters are bodies that are seen and cast shadows.
"""

from __future__ import annotations

import numpy as np

from tracer.light_samples import coordinates, pattern
from tracer.lights import LightRecord


def point(light: LightRecord) -> np.ndarray:
    """(1, 3): the point."""
    return _samples(light)


def ring(light: LightRecord) -> np.ndarray:
    """(n, 3): points on the circle, without jitter."""
    return _samples(light)


def disk(light: LightRecord) -> np.ndarray:
    """(n, 3): points in the disk, without jitter."""
    return _samples(light)


def sphere(light: LightRecord) -> np.ndarray:
    """(n, 3): points on the sphere, without jitter."""
    return _samples(light)


def rectangle(light: LightRecord) -> np.ndarray:
    """(n, 3): points in the rectangle, without jitter."""
    return _samples(light)


def _samples(light: LightRecord) -> np.ndarray:
    samples = pattern(light)
    alpha, beta = coordinates(samples)
    return samples.base + alpha[:, None] * samples.a + beta[:, None] * samples.b
