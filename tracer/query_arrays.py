"""Arrays of ray queries: checked on their way to Dr.Jit memory, and on the way back the numbers of what was
hit."""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike

from tracer.backends import INVALID, Backend
from tracer.device_scene import DeviceScene
from tracer.errors import UsageError
from tracer.ray import Hit, normalize

UNIT_SLACK = 6
"""How far from 1 the square of a unit vector's length may be, in eps: its components round (2), and so does
the sum of their squares (4)."""


def points_from(values: ArrayLike, name: str, backend: Backend) -> np.ndarray:
    """(n, 3) float64 in the range of the precision; raises `UsageError` that names the argument."""
    array = vectors_from(values, name)
    limit = float(np.sqrt(np.finfo(backend.dtype).max / 12))  # |p - q|² is at most 3 (2 limit)²
    far = (np.abs(array) > limit).any(axis=1)
    if far.any():
        row = int(np.argmax(far))
        raise UsageError(
            f"{name}: row {row} is {array[row].tolist()}; "
            f"allowed in {backend.precision} precision are coordinates up to {limit:.2g}"
        )
    return array


def vectors_from(values: ArrayLike, name: str) -> np.ndarray:
    """(n, 3) finite float64; raises `UsageError` that names the argument."""
    try:
        array = np.atleast_2d(np.asarray(values, np.float64))
    except (TypeError, ValueError):
        raise UsageError(f"{name}: these are no numbers; allowed is an array (n, 3) of them") from None
    if array.ndim != 2 or array.shape[1] != 3:
        raise UsageError(f"{name}: the shape is {np.shape(values)}; allowed is (n, 3)")
    if not np.isfinite(array).all():
        row = int(np.argmin(np.isfinite(array).all(axis=1)))
        raise UsageError(f"{name}: row {row} is {array[row].tolist()}; allowed are finite numbers")
    return array


def rays_from(origins: ArrayLike, directions: ArrayLike, backend: Backend) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions, (n, 3) each, the latter of any length but 0; raises `UsageError`."""
    o, d = points_from(origins, "origins", backend), vectors_from(directions, "directions")
    zero = np.abs(d).max(axis=1) < np.finfo(np.float64).tiny  # subnormal numbers are zero here, as in kernels
    if zero.any():
        raise UsageError(f"directions: row {int(np.argmax(zero))} is zero; allowed is a direction")
    return paired(o, d, "origins and directions")


def paired(first: np.ndarray, second: np.ndarray, names: str) -> tuple[np.ndarray, np.ndarray]:
    """Both with the same number of rows n: one row stands for n; raises `UsageError` that names them."""
    if len(first) != len(second) and 1 not in (len(first), len(second)):
        raise UsageError(f"{names}: {len(first)} and {len(second)} rows; allowed is one number")
    a, b = np.broadcast_arrays(first, second)
    return np.ascontiguousarray(a), np.ascontiguousarray(b)


def distances_from(t_max: ArrayLike, n: int) -> np.ndarray:
    """(n,) float64 without NaN; raises `UsageError`."""
    try:
        limit = np.broadcast_to(np.asarray(t_max, np.float64), n)
    except (TypeError, ValueError):
        raise UsageError(f"t_max: the shape is {np.shape(t_max)}; allowed is a number or ({n},)") from None
    if np.isnan(limit).any():
        raise UsageError("t_max: NaN is not allowed")
    return limit


def upload(backend: Backend, values: np.ndarray) -> Any:
    """Vectors (n, 3) as (3, n) in Dr.Jit memory."""
    return backend.Vector3(*(backend.Float(np.ascontiguousarray(c, backend.dtype)) for c in values.T))


def upload_directions(backend: Backend, directions: np.ndarray) -> Any:
    """Unit directions; scaled first, so that no square vanishes or overflows.

    Those that have unit length within rounding stay as they are: normalized once more, a ray could pass on
    the other side of the edge or corner that it is aimed at.
    """
    with np.errstate(over="ignore"):  # what single precision cannot hold has no unit length
        given = upload(backend, directions)
    is_unit = dr.abs(dr.squared_norm(given) - 1) <= UNIT_SLACK * backend.epsilon
    scaled = upload(backend, directions / np.abs(directions).max(axis=1, keepdims=True))
    return dr.select(is_unit, given, normalize(scaled))


def numbers_of(device: DeviceScene, hit: Hit, surface: Any) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the shape and of the primitive within it (n,), -1 on a miss."""
    primitive = hit.primitive.numpy().astype(np.int64)
    valid = primitive != INVALID
    shape = np.where(valid, surface.shape.numpy().astype(np.int64), -1)
    first = device.host.first_primitive
    return shape, np.where(valid, primitive - first[np.maximum(shape, 0)], -1)
