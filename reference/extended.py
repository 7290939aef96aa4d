"""Closed forms in extended precision: hits of planes, spheres, triangles; mirror, refraction, camera rays.

Numbers are NumPy's long double where its epsilon is below 1e-18 (x86), else those of mpmath with 113 bits.
All functions take (n, 3) and (n,) arrays of doubles or of extended numbers and give extended ones; doubles
are taken at their word, so what comes out is wrong by a few 1e-19 of its terms only.
"""

from __future__ import annotations

import importlib
from typing import Any, TypeAlias

import numpy as np

from tracer.camera import Camera
from tracer.errors import MachineError

Extended: TypeAlias = np.ndarray
"""Long doubles, or objects of mpmath."""

HAS_LONG_DOUBLE = bool(np.finfo(np.longdouble).eps < 1e-18)
MPMATH_BITS = 113


def _mpmath() -> Any:
    try:
        module = importlib.import_module("mpmath")
    except ImportError:
        raise MachineError(
            "numpy's long double is no wider than a double here, and mpmath is not installed; "
            "`pip install mpmath` installs it"
        ) from None
    module.mp.prec = MPMATH_BITS
    return module


def number(values: Any) -> Extended:
    """Doubles (or extended numbers) as extended numbers, unchanged."""
    if HAS_LONG_DOUBLE:
        return np.asarray(values, np.longdouble)
    module, array = _mpmath(), np.asarray(values)
    return array if array.dtype == object else np.frompyfunc(module.mpf, 1, 1)(array.astype(np.float64))


def _function(name: str, x: Any) -> Extended:
    if HAS_LONG_DOUBLE:
        return np.asarray(getattr(np, name)(number(x)))
    return np.asarray(np.frompyfunc(getattr(_mpmath(), name), 1, 1)(number(x)))


def square_root(x: Any) -> Extended:
    """The root of x >= 0; 0 where x is negative (callers keep the sign of x)."""
    x = number(x)
    return _function("sqrt", np.where(x > 0, x, number(0.0)))


def cosine_sine(degrees: float) -> tuple[Extended, Extended]:
    """cos and sin of an angle in degrees."""
    half_turn = 4 * np.arctan(np.longdouble(1)) if HAS_LONG_DOUBLE else +_mpmath().pi
    angle = number(degrees) * half_turn / 180
    return _function("cos", angle), _function("sin", angle)


def dot(a: Any, b: Any) -> Extended:
    """Scalar products along the last axis."""
    products = number(a) * number(b)
    return np.asarray(products[..., 0] + products[..., 1] + products[..., 2])


def cross(a: Any, b: Any) -> Extended:
    """Vector products along the last axis."""
    a, b = number(a), number(b)
    return np.stack(
        [a[..., i - 2] * b[..., i - 1] - a[..., i - 1] * b[..., i - 2] for i in range(3)], axis=-1
    )


def unit(v: Any) -> Extended:
    """v / |v|."""
    return number(v) / square_root(dot(v, v))[..., None]


def double(x: Any) -> np.ndarray:
    """The nearest doubles."""
    return np.asarray(x).astype(np.float64)


def plane_hit(o: Any, d: Any, plane: Any) -> tuple[Extended, Extended]:
    """t along unit d, and the unit normal, of planes (n, 4) with n.p + d = 0."""
    plane = number(plane)
    normal = plane[..., :3]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -(dot(normal, o) + plane[..., 3]) / dot(normal, d)
    return t, unit(normal)


def sphere_roots(o: Any, d: Any, sphere: Any) -> tuple[Extended, Extended, Extended]:
    """Both t along unit d where lines meet spheres (n, 4) of center and radius, and the squared half chord,
    which is negative where they do not."""
    sphere = number(sphere)
    oc = number(o) - sphere[..., :3]
    middle = -dot(oc, d)
    perpendicular = oc + middle[..., None] * number(d)
    chord = sphere[..., 3] ** 2 - dot(perpendicular, perpendicular)
    half = square_root(chord)
    return middle - half, middle + half, chord


def triangle_hit(o: Any, d: Any, corners: Any) -> tuple[Extended, Extended]:
    """t along unit d to the planes of triangles (n, 3, 3), and their unit normals, counterclockwise from
    outside."""
    corners = number(corners)
    a = corners[..., 0, :]
    normal = cross(corners[..., 1, :] - a, corners[..., 2, :] - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = dot(normal, a - number(o)) / dot(normal, d)
    return t, unit(normal)


def inside_triangle(p: Any, corners: Any) -> np.ndarray:
    """Mask: points p of their planes lie in triangles (n, 3, 3), borders included."""
    corners = number(corners)
    a, b, c = (corners[..., k, :] for k in range(3))
    normal, p = cross(b - a, c - a), number(p)
    sides = [dot(cross(v - u, p - u), normal) >= 0 for u, v in ((a, b), (b, c), (c, a))]
    return np.asarray(sides[0] & sides[1] & sides[2])


def barycentrics(p: Any, corners: Any) -> Extended:
    """(n, 3) weights of the corners at points of triangles (n, 3, 3)."""
    corners = number(corners)
    a, b, c = (corners[..., k, :] for k in range(3))
    normal = cross(b - a, c - a)
    area = dot(normal, normal)
    second = dot(cross(p - a, c - a), normal) / area
    third = dot(cross(b - a, p - a), normal) / area
    return np.stack([1 - second - third, second, third], axis=-1)


def mirror(d: Any, n: Any) -> Extended:
    """r = d - 2 (n.d) n for unit n (document, section 3)."""
    return number(d) - 2 * dot(n, d)[..., None] * number(n)


def refract(d: Any, n: Any, eta: Any) -> tuple[Extended, Extended]:
    """t = eta d + (eta c - sqrt k) n with c = -n.d, and k; for k < 0, total reflection, t means nothing
    (document, section 3). `n` faces the ray; eta is 1/ior entering, ior leaving."""
    eta, c = number(eta), -dot(n, d)
    k = 1 - eta**2 * (1 - c**2)
    return eta[..., None] * number(d) + (eta * c - square_root(k))[..., None] * number(n), k


def camera_rays(camera: Camera, columns: Any, rows: Any) -> tuple[Extended, Extended]:
    """Origins and unit directions of the rays through canvas points in pixels from the top-left corner
    (document, section 7), from the numbers of the scene file."""
    center, x, y, forward, pixel_size = frame(camera)
    width, height = camera.resolution
    across = (number(columns) - number(width / 2))[:, None] * pixel_size * x
    across = across + (number(rows) - number(height / 2))[:, None] * pixel_size * y
    return center + across, unit(number(camera.eye_distance) * forward + across)


def pixel_offset(camera: Camera, literal: bool) -> float:
    """The place of a ray in its pixel, 0 to 1 in both directions."""
    own = camera.pixel_offset
    return (0.0 if literal else 0.5) if own is None else own


def frame(camera: Camera) -> tuple[Extended, Extended, Extended, Extended, Extended]:
    """Canvas center, unit vectors to the right, down and forward, and the size of a pixel."""
    return _look_at(camera) if camera.is_look_at else _canvas(camera)


def _canvas(camera: Camera) -> tuple[Extended, Extended, Extended, Extended, Extended]:
    x, y, forward = (number(v) for v in ([1.0, 0, 0], [0, -1.0, 0], [0, 0, -1.0]))
    cos, sin = cosine_sine(camera.rotate[0])
    forward, x = cos * forward - sin * x, cos * x + sin * forward
    cos, sin = cosine_sine(camera.rotate[1])
    forward, y = cos * forward - sin * y, cos * y + sin * forward
    return number(camera.position), x, y, forward, number(camera.pixel_size)


def _look_at(camera: Camera) -> tuple[Extended, Extended, Extended, Extended, Extended]:
    assert camera.fov is not None
    origin, distance = number(camera.origin), number(camera.eye_distance)
    forward = unit(number(camera.target) - origin)
    x = unit(cross(forward, camera.up))
    cos, sin = cosine_sine(camera.fov / 2)
    return (
        origin + distance * forward,
        x,
        cross(forward, x),
        forward,
        2 * distance * sin / cos / camera.resolution[1],
    )
