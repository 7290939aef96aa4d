"""Plain ray queries: NumPy in, NumPy out (document, sections 3 to 5).

`intersect` finds the nearest hit of any ray, `visible` whether two points see each other, `trace_path`
follows a chain of mirror reflections and refractions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike

from tracer.backends import INVALID, Backend, exact_arithmetic, find_backend
from tracer.device_scene import DeviceScene, compile_scene
from tracer.errors import UsageError
from tracer.intersection import closest_hit, free_ray
from tracer.leaving import leave
from tracer.ray import Hit, Ray, normalize
from tracer.scene import Scene
from tracer.spawn import material_at, refract_direction
from tracer.surface import surface_at

UNIT_SLACK = 6
"""How far from 1 the square of a unit vector's length may be, in eps: its components round (2), and so does
the sum of their squares (4)."""

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

    Raises: `UsageError` for wrong shapes, NaN and zero directions.
    """
    types = find_backend(backend, precision)
    o, d = _rays(origins, directions)
    limit = None if t_max is None else _distances(t_max, len(o))
    if not len(o):
        return _no_hits()
    with exact_arithmetic():
        device = compile_scene(scene, types)
        ray = free_ray(device, _upload(types, o), _upload_directions(types, d))
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
    p, q = _points(points, "points"), _points(targets, "targets")
    p, q = (np.ascontiguousarray(a) for a in np.broadcast_arrays(p, q))
    if not len(p):
        return np.zeros(0, bool)
    with exact_arithmetic():
        device = compile_scene(scene, types)
        guard = END_GUARD[precision] * max(np.abs(p).max(), np.abs(q).max(), device.host.extent)
        length = np.linalg.norm(q - p, axis=1)
        apart = length > 2 * guard
        d = np.where(apart[:, None], q - p, [1.0, 0.0, 0.0])
        d /= np.linalg.norm(d, axis=1)[:, None]
        ray = free_ray(device, _upload(types, p + guard * d), _upload_directions(types, d))
        reach = types.Float(np.where(apart, length - 2 * guard, 0).astype(types.dtype))
        hit = closest_hit(device, ray, types.Bool(apart), reach)
        blocked = hit.valid.numpy()
    return ~blocked


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
    o, d = _rays(origins, directions)
    refracts = _events(events, len(o))
    n, k = refracts.shape
    position, direction = np.full((n, k, 3), np.nan), np.full((n, k, 3), np.nan)
    shape, primitive, count = np.full((n, k), -1), np.full((n, k), -1), np.zeros(n, np.int64)
    if not n or not k:
        return Paths(position, direction, shape, primitive, count)
    with exact_arithmetic():
        device = compile_scene(scene, types)
        ray = free_ray(device, _upload(types, o), _upload_directions(types, d))
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
                numbers[reached] for numbers in _numbers(device, hit, surface)
            )
            count += reached
            active = leaves
    return Paths(position, direction, shape, primitive, count)


def _events(events: str | Sequence[str], n: int) -> np.ndarray:
    """(n, k) bool: the event is a refraction. Data, not structure: all chains share one kernel."""
    rows = [events] if isinstance(events, str) else list(events)
    for row in rows:
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


def _hits(device: DeviceScene, hit: Hit, surface: Any) -> Hits:
    valid = hit.primitive.numpy() != INVALID
    shape, primitive = _numbers(device, hit, surface)
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


def _numbers(device: DeviceScene, hit: Hit, surface: Any) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the shape and of the primitive within it (n,), -1 on a miss."""
    primitive = hit.primitive.numpy().astype(np.int64)
    valid = primitive != INVALID
    shape = np.where(valid, surface.shape.numpy().astype(np.int64), -1)
    first = device.host.first_primitive
    return shape, np.where(valid, primitive - first[np.maximum(shape, 0)], -1)


def _no_hits() -> Hits:
    ids, vectors = np.zeros(0, np.int64), np.zeros((0, 3))
    return Hits(np.zeros(0), ids, ids, ids, vectors, vectors, np.zeros(0, bool))


def _points(values: ArrayLike, name: str) -> np.ndarray:
    """(n, 3) finite float64."""
    array = np.atleast_2d(np.asarray(values, np.float64))
    if array.ndim != 2 or array.shape[1] != 3:
        raise UsageError(f"{name}: the shape is {np.shape(values)}; allowed is (n, 3)")
    if not np.isfinite(array).all():
        row = int(np.argmin(np.isfinite(array).all(axis=1)))
        raise UsageError(f"{name}: row {row} is {array[row].tolist()}; allowed are finite numbers")
    return array


def _rays(origins: ArrayLike, directions: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    o, d = _points(origins, "origins"), _points(directions, "directions")
    zero = ~d.any(axis=1)
    if zero.any():
        raise UsageError(f"directions: row {int(np.argmax(zero))} is zero; allowed is a direction")
    try:
        o, d = (np.ascontiguousarray(a) for a in np.broadcast_arrays(o, d))
    except ValueError:
        raise UsageError(
            f"origins and directions: {len(o)} and {len(d)} rows; allowed is one number"
        ) from None
    return o, d


def _distances(t_max: ArrayLike, n: int) -> np.ndarray:
    try:
        limit = np.broadcast_to(np.asarray(t_max, np.float64), n)
    except ValueError:
        raise UsageError(f"t_max: the shape is {np.shape(t_max)}; allowed is a number or ({n},)") from None
    if np.isnan(limit).any():
        raise UsageError("t_max: NaN is not allowed")
    return limit


def _upload(backend: Backend, values: np.ndarray) -> Any:
    return backend.Vector3(*(backend.Float(np.ascontiguousarray(c, backend.dtype)) for c in values.T))


def _upload_directions(backend: Backend, directions: np.ndarray) -> Any:
    """Unit directions; scaled first, so that no square vanishes or overflows.

    Those that have unit length within rounding stay as they are: normalized once more, a ray could pass on
    the other side of the edge or corner that it is aimed at.
    """
    given = _upload(backend, directions)
    is_unit = dr.abs(dr.squared_norm(given) - 1) <= UNIT_SLACK * backend.epsilon
    scaled = _upload(backend, directions / np.abs(directions).max(axis=1, keepdims=True))
    return dr.select(is_unit, given, normalize(scaled))
