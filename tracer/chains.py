"""Specular chains: rays followed through mirror reflections and refractions (document, sections 3 and 5)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike

from tracer.backends import exact_arithmetic, find_backend
from tracer.device_scene import DeviceScene, compile_scene
from tracer.errors import UsageError
from tracer.given_scene import given_scene
from tracer.intersection import closest_hit, free_ray
from tracer.leaving import leave
from tracer.query_arrays import numbers_of, rays_from, upload, upload_directions
from tracer.ray import Ray
from tracer.scene import Scene
from tracer.spawn import material_at, refract_direction
from tracer.surface import surface_at


@dataclass(frozen=True)
class Paths:
    """Specular chains of n rays with k events.

    `position` (n, k, 3) of each vertex, `direction` (n, k, 3) in which the chain leaves it (NaN after total
    reflection), `shape`, `primitive` (n, k) numbers as in `Hits`, `count` (n,) vertices reached. NaN and -1
    where unused.
    """

    position: np.ndarray
    direction: np.ndarray
    shape: np.ndarray
    primitive: np.ndarray
    count: np.ndarray


def trace_path(
    scene: Scene,
    origins: ArrayLike,
    directions: ArrayLike,
    events: str | Sequence[str],
    *,
    precision: str = "double",
    backend: str = "auto",
) -> Paths:
    """One specular chain a ray: at every vertex the next of `events`, R for mirror, T for refraction.

    Materials only give the index of refraction; their shares and the cut-off play no part. Total reflection
    under a T ends the chain: its vertex counts, its direction is NaN.

    Args:
        origins, directions: (n, 3), or (3,) for one; directions need not be normalized.
        events: one string for all rays, or n strings of one length k, one for each.

    Raises: `UsageError` for wrong shapes, NaN and zero directions, other letters than R and T.
    """
    types = find_backend(backend, precision)
    scene, (o, d) = given_scene(scene), rays_from(origins, directions, types)
    refracts = _events(events, len(o))
    n, k = refracts.shape
    position, direction = np.full((n, k, 3), np.nan), np.full((n, k, 3), np.nan)
    shape, primitive, count = np.full((n, k), -1), np.full((n, k), -1), np.zeros(n, np.int64)
    if not n or not k:
        return Paths(position, direction, shape, primitive, count)
    with exact_arithmetic():
        device = compile_scene(scene, types)
        ray = free_ray(device, upload(types, o), upload_directions(types, d))
        active = dr.full(types.Bool, True, n)
        for step in range(k):
            hit = closest_hit(device, ray, active)
            active = active & hit.valid
            surface = surface_at(device, ray, hit, active)
            ray, ends = _event(device, ray, surface, types.Bool(refracts[:, step].copy()), active)
            leaves = active & ~ends
            dr.eval(hit, ray, surface, active, leaves)
            reached, left = active.numpy(), leaves.numpy()
            position[reached, step] = surface.p.numpy().T[reached]
            direction[left, step] = ray.d.numpy().T[left]
            shape[reached, step], primitive[reached, step] = (
                numbers[reached] for numbers in numbers_of(device, hit, surface)
            )
            count += reached
            active = leaves
    return Paths(position, direction, shape, primitive, count)


def _events(events: str | Sequence[str], n: int) -> np.ndarray:
    """(n, k) bool: the event is a refraction. Data, not structure: all chains share one kernel."""
    rows = list(events) if isinstance(events, Iterable) and not isinstance(events, str) else [events]
    for row in rows:
        if not isinstance(row, str):
            raise UsageError(f"events: {row!r} is no string; allowed are the letters R and T")
        wrong = sorted(set(row) - {"R", "T"})
        if wrong:
            raise UsageError(f"events: {row!r} contains {wrong[0]!r}; allowed are the letters R and T")
    lengths = sorted({len(row) for row in rows})
    if not isinstance(events, str) and (len(rows) != n or len(lengths) > 1):
        raise UsageError(
            f"events: {len(rows)} strings of {lengths} letters; allowed are one string, or {n} of one length"
        )
    table = np.array([[letter == "T" for letter in row] for row in rows], bool)
    table = table.reshape(len(rows), lengths[0] if lengths else 0)
    return np.repeat(table, n, axis=0) if isinstance(events, str) else table


def _event(device: DeviceScene, ray: Ray, surface: Any, refracts: Any, active: Any) -> tuple[Ray, Any]:
    """The rays after a refraction where `refracts`, else after a mirror reflection, and the mask of total
    reflection."""
    ior = material_at(device, surface, active).ior
    bent, total = refract_direction(ray.d, surface.normal, ior, surface.entering)
    mirrored, through = (
        leave(ray, surface, d, crosses) for d, crosses in ((surface.mirrored, False), (bent, True))
    )
    return dr.select(refracts, through, mirrored), active & refracts & total
