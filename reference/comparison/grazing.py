"""How far a ray passes from where rounding decides: silhouettes, edges, ties of two surfaces, borders of
shadows.

Distances are lengths in scene units, computed in double precision; callers divide them by eps S of single
precision and compare with the row "grazing band" of the table of tolerances.
"""

from __future__ import annotations

import numpy as np

from reference import extended
from reference.comparison.truth import MESH, PLANE, SPHERE, Truth

Array = np.ndarray

BATCH = 4_000_000
"""Pairs of a ray and an edge that are looked at together."""


def unit(v: Array) -> Array:
    """v / |v| along the last axis."""
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def silhouette_distance(truth: Truth, o: Array, d: Array, reach: Array) -> Array:
    """(n,) distance of rays (n, 3), up to the distance `reach` (n,), from the nearest silhouette of a sphere
    or edge of a triangle; infinite without any.

    A sphere has a silhouette for rays that start outside: | |o + b d - c| - r | at the closest approach b.
    Edges count wherever they lie, those between two triangles of a flat face too: there the triangle's number
    is in doubt.
    """
    d = unit(d)
    nearest = np.full(len(o), np.inf)
    for row in truth.rows[truth.kind == SPHERE]:
        oc = o - row[:3]
        b = -(oc * d).sum(axis=1)
        gap = np.abs(np.linalg.norm(oc + b[:, None] * d, axis=1) - row[3])
        outside = (oc**2).sum(axis=1) > row[3] ** 2
        counts = outside & (b > 0) & (b - row[3] < reach)
        nearest = np.where(counts, np.minimum(nearest, gap), nearest)
    return np.minimum(nearest, edge_distance(truth.edges, o, d, reach))


def edge_distance(ends: Array, o: Array, d: Array, reach: Array) -> Array:
    """(n,) distance of rays from the nearest of the edges (m, 2, 3) that lie before `reach`."""
    nearest = np.full(len(o), np.inf)
    if not len(ends):
        return nearest
    step = max(1, BATCH // len(ends))
    for k in range(0, len(o), step):
        part = slice(k, k + step)
        nearest[part] = _edge_distance(ends, o[part], d[part], reach[part])
    return nearest


def _edge_distance(ends: Array, o: Array, d: Array, reach: Array) -> Array:
    """The edges are seen along the ray: the distance is that of a segment of the plane from the origin."""
    helper = np.eye(3)[np.argmin(np.abs(d), axis=1)]
    u = unit(np.cross(helper, d))
    v = np.cross(d, u)

    def along(axis: Array) -> Array:
        """(n, m, 2): the ends in a coordinate of each ray's frame."""
        flat = axis @ ends.reshape(-1, 3).T - (axis * o).sum(axis=1)[:, None]
        return np.asarray(flat.reshape(len(o), len(ends), 2))

    x, y, z = along(u), along(v), along(d)
    dx, dy = x[..., 1] - x[..., 0], y[..., 1] - y[..., 0]
    length = dx**2 + dy**2
    share = -(x[..., 0] * dx + y[..., 0] * dy) / np.where(length > 0, length, 1)
    share = np.clip(share, 0, 1)
    distance = np.hypot(x[..., 0] + share * dx, y[..., 0] + share * dy)
    at = z[..., 0] + share * (z[..., 1] - z[..., 0])
    before = (at > 0) & (at < reach[:, None] * (1 + 1e-6) + distance)
    return np.asarray(np.where(before, distance, np.inf).min(axis=1))


def tie_distance(truth: Truth, o: Array, d: Array, a: Array, b: Array) -> Array:
    """(n,) how far apart two primitives (n, 2: shape, primitive) are where a ray meets both: |t_a - t_b| over
    1/cos a + 1/cos b, the error of each t in units of the error across its surface. Infinite where the ray
    does not meet both."""
    d = extended.double(extended.unit(d))
    gap, spread = np.zeros(len(o)), np.zeros(len(o))
    for sign, primitive in ((1, a), (-1, b)):
        t, normal = truth.hit(o, d, primitive[:, 0], primitive[:, 1])
        cosine = np.abs(extended.double(extended.dot(normal, d)))
        gap += sign * extended.double(t)
        spread += 1 / np.maximum(cosine, 1e-30)
    gap = np.abs(gap) / spread
    return np.asarray(np.where(np.isfinite(gap), gap, np.inf))


def start_distance(truth: Truth, p: Array) -> Array:
    """(n,) distance of points from the nearest surface: there rounding decides on which side a ray starts,
    or a way to a light ends."""
    nearest = np.full(len(p), np.inf)
    for kind, row in zip(truth.kind, truth.rows, strict=True):
        if kind == PLANE:
            nearest = np.minimum(nearest, np.abs(p @ row[:3] + row[3]))
        elif kind == SPHERE:
            nearest = np.minimum(nearest, np.abs(np.linalg.norm(p - row[:3], axis=1) - row[3]))
    for k in range(len(p)) if MESH in truth.kind else ():
        nearest[k] = min(nearest[k], _triangle_distance(truth.corners[truth.usable], p[k]))
    return nearest


def inner_distance(p: Array, corners: Array) -> Array:
    """(n,) distance of points (n, 3) of triangles (n, 3, 3) from the nearest of their edges' lines."""
    nearest = np.full(len(p), np.inf)
    for k in range(3):
        start, way = corners[:, k], unit(corners[:, (k + 1) % 3] - corners[:, k])
        nearest = np.minimum(nearest, np.linalg.norm(np.cross(p - start, way), axis=1))
    return nearest


def _triangle_distance(corners: Array, p: Array) -> float:
    """Distance of a point from the nearest triangle whose prism it lies in (its edges count elsewhere)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = unit(np.cross(b - a, c - a))
    height = ((p - a) * normal).sum(axis=1)
    above = np.ones(len(corners), bool)
    for start, end in ((a, b), (b, c), (c, a)):
        above &= (np.cross(end - start, p - start) * normal).sum(axis=1) >= 0
    return float(np.abs(height[above]).min(initial=np.inf))
