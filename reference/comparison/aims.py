"""Rays aimed at edges and corners of meshes, from where all triangles there face them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reference.comparison.case import Case, once_a_scene
from reference.comparison.fans import Fans, Spread
from reference.comparison.rays import RaySet, single
from reference.comparison.truth import Truth
from reference.exact import edge_functions, passes_through
from reference.tolerances import TOLERANCES

Array = np.ndarray

EDGES, CORNERS, ALONG_AXES = "edges", "corners", "corners, along axes"
SHARES = {EDGES: 1 / 2, CORNERS: 3 / 8, ALONG_AXES: 1 / 8}
"""What rays are aimed at. Along axes no rounding moves them off: they meet their corner exactly."""

TRIES = {EDGES: 2, CORNERS: 3, ALONG_AXES: 12}
"""Rays made for each that is wanted, as some see their fan from behind."""

NEAR, FAR = 0.01, 3.0
"""Length of the ways to the fan, in sizes of all meshes together; as many short ones as long ones."""


@dataclass(frozen=True)
class Aimed:
    """n rays, the fans that they are aimed at, the distance `t` (n,) at which they meet them, infinite where
    exact arithmetic says that they do not, and the smallest |cosine| of arrival."""

    rays: RaySet
    fans: Spread
    t: Array
    cosine: Array


@once_a_scene
def aimed(case: Case) -> Aimed:
    """The rays of a scene: at most as many as others have."""
    truth, rng = case.bench.truth, np.random.default_rng([case.seed, 5])
    fans = Fans.of(truth)
    parts = [_aim(truth, fans, what, round(share * case.bench.count), rng) for what, share in SHARES.items()]
    chosen, o, d = (np.concatenate(column) for column in zip(*parts, strict=True))
    spread = fans.spread(chosen)
    corners, ray = truth.corners[spread.members], spread.of
    t, cosine = arrival(corners, o[ray], d[ray])
    met = passes_through(edge_functions(o[ray], d[ray], corners))
    rays = RaySet(o, d, np.full((len(o), 2), -1))
    return Aimed(rays, spread, spread.least(np.where(met, t, np.inf)), spread.least(-cosine))


def _aim(
    truth: Truth, fans: Fans, what: str, count: int, rng: np.random.Generator
) -> tuple[Array, Array, Array]:
    """Numbers of fans, origins and directions (n, 3) in single precision; the whole fan faces the ray."""
    kind = np.flatnonzero(fans.is_edge == (what == EDGES))
    chosen = kind[rng.integers(len(kind), size=TRIES[what] * count)] if len(kind) else kind
    spread, n = fans.spread(chosen), len(chosen)
    share = rng.uniform(size=(n, 1)) if what == EDGES else np.zeros((n, 1))
    target = (1 - share) * fans.ends[chosen, 0] + share * fans.ends[chosen, 1]
    normals = normals_of(truth.corners)[spread.members] if n else np.zeros((0, 3))
    if what == ALONG_AXES:
        way = np.eye(3)[rng.integers(3, size=n)] * rng.choice([-1.0, 1.0], (n, 1))
    else:
        way = _unit(rng.uniform(size=(n, 1)) * _unit(rng.normal(size=(n, 3))) - _unit(spread.total(normals)))
    size = np.linalg.norm(np.ptp(truth.corners.reshape(-1, 3), axis=0)) if n else 0
    o = single(target - size * np.exp(rng.uniform(np.log(NEAR), np.log(FAR), (n, 1))) * way)
    d = single(way if what == ALONG_AXES else _unit(target - o))
    facing = spread.least(-(normals * d[spread.of]).sum(axis=1)) > TOLERANCES["fronting"].value
    kept = np.flatnonzero(facing)[:count]
    return chosen[kept], o[kept], d[kept]


def arrival(corners: Array, o: Array, d: Array) -> tuple[Array, Array]:
    """Where rays meet the planes of triangles (n, 3, 3), as a distance, and the cosine there, negative in
    front."""
    way, normal = _unit(d), normals_of(corners)
    cosine = (normal * way).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return (normal * (corners[:, 0] - o)).sum(axis=1) / cosine, cosine


def normals_of(corners: Array) -> Array:
    """(n, 3) unit normals, zero where there is none."""
    return _unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def _unit(v: Array) -> Array:
    length = np.linalg.norm(v, axis=1, keepdims=True)
    return np.asarray(v / np.where(length > 0, length, 1))
