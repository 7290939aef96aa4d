"""Plain ray queries: NumPy in, NumPy out (document, sections 4 and 5).

`intersect` finds the nearest hit of any ray, `visible` whether two points see each other. Chains of rays are
followed in `tracer.chains`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike

from tracer.backends import INVALID, Backend, exact_arithmetic, find_backend
from tracer.device_scene import DeviceScene, compile_scene
from tracer.given_scene import given_scene
from tracer.intersection import closest_hit, free_ray
from tracer.query_arrays import (
    distances_from,
    numbers_of,
    paired,
    points_from,
    rays_from,
    upload,
    upload_directions,
)
from tracer.ray import Hit
from tracer.scene import Scene
from tracer.surface import surface_at

END_GUARD = {"single": 1e-5, "double": 1e-9}
"""`visible`: hits nearer to either end than this times S do not count."""


@dataclass(frozen=True)
class Hits:
    """The nearest hits of n rays.

    `t` (n,) distance along the unit direction, inf on a miss; `shape`, `primitive`, `face` (n,) int64 numbers
    of the shape, of the triangle in file order (0 for spheres and planes) and of the file's face, -1 on a
    miss; `normal` (n, 3) outward geometric unit normal, `position` (n, 3), NaN on a miss; `valid` (n,) bool.
    """

    t: np.ndarray
    shape: np.ndarray
    primitive: np.ndarray
    face: np.ndarray
    normal: np.ndarray
    position: np.ndarray
    valid: np.ndarray


def intersect(
    scene: Scene,
    origins: ArrayLike,
    directions: ArrayLike,
    *,
    t_max: ArrayLike | None = None,
    precision: str = "double",
    backend: str = "auto",
) -> Hits:
    """The nearest hit of each ray.

    Args:
        origins, directions: (n, 3), or (3,) for one; directions need not be normalized.
        t_max: (n,) or a number: hits beyond this distance do not count.

    Raises: `UsageError` for wrong shapes, NaN, zero directions, and coordinates whose squares leave the range
        of the precision.
    """
    types = find_backend(backend, precision)
    scene, (o, d) = given_scene(scene), rays_from(origins, directions, types)
    limit = None if t_max is None else distances_from(t_max, len(o))
    if not len(o):
        return _no_hits(types)
    with exact_arithmetic():
        device = compile_scene(scene, types)
        ray = free_ray(device, upload(types, o), upload_directions(types, d))
        everything = dr.full(types.Bool, True, len(o))
        reach = None if limit is None else types.Float(limit.astype(types.dtype))
        hit = closest_hit(device, ray, everything, reach)
        surface = surface_at(device, ray, hit, everything)
        dr.eval(hit, surface)
    return _hits(device, hit, surface)


def visible(
    scene: Scene, points: ArrayLike, targets: ArrayLike, *, precision: str = "double", backend: str = "auto"
) -> np.ndarray:
    """(n,) bool: nothing lies strictly between points (n, 3) and targets (n, 3).

    Hits nearer to either end than 1e-9 S (double) or 1e-5 S (single precision) do not count, S the largest
    |coordinate| among points, targets and finite shapes.
    """
    types = find_backend(backend, precision)
    scene = given_scene(scene)
    p, q = points_from(points, "points", types), points_from(targets, "targets", types)
    p, q = paired(p, q, "points and targets")
    if not len(p):
        return np.zeros(0, bool)
    with exact_arithmetic():
        device = compile_scene(scene, types)
        guard = END_GUARD[precision] * max(np.abs(p).max(), np.abs(q).max(), device.host.extent)
        length = np.linalg.norm(q - p, axis=1)
        apart = length > 2 * guard
        d = np.where(apart[:, None], q - p, [1.0, 0.0, 0.0])
        d /= np.linalg.norm(d, axis=1)[:, None]
        ray = free_ray(device, upload(types, p + guard * d), upload_directions(types, d))
        reach = types.Float(np.where(apart, length - 2 * guard, 0).astype(types.dtype))
        hit = closest_hit(device, ray, types.Bool(apart), reach)
        blocked = hit.valid.numpy()
    return ~blocked


def _hits(device: DeviceScene, hit: Hit, surface: Any) -> Hits:
    valid = hit.primitive.numpy() != INVALID
    shape, primitive = numbers_of(device, hit, surface)
    face = primitive.copy()
    for number, mesh in device.host.meshes.items():
        here = shape == number
        face[here] = mesh.faces[primitive[here]]
    return Hits(
        t=np.where(valid, hit.t.numpy(), np.inf),
        shape=shape,
        primitive=primitive,
        face=face,
        normal=np.where(valid[:, None], surface.outward.numpy().T, np.nan),
        position=np.where(valid[:, None], surface.p.numpy().T, np.nan),
        valid=valid,
    )


def _no_hits(backend: Backend) -> Hits:
    ids, vectors = np.zeros(0, np.int64), np.zeros((0, 3), backend.dtype)
    return Hits(np.zeros(0, backend.dtype), ids, ids, ids, vectors, vectors, np.zeros(0, bool))
