"""The rays of a comparison: through pixels and from anywhere, in numbers that single precision holds exactly,
so that all sides are asked the same question."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import tracer
from reference import extended
from reference.comparison.truth import MESH, SPHERE, Truth

Array = np.ndarray

AT_SILHOUETTES = 0.02
"""Share of the free rays that are aimed at silhouettes, up to 1e-4 of the radius to either side."""


@dataclass(frozen=True)
class RaySet:
    """n rays: `o`, `d` (n, 3) doubles that are single precision numbers (d unit up to that rounding), `pixel`
    (n, 2) column and row, -1 for rays of no pixel."""

    o: Array
    d: Array
    pixel: Array

    def __len__(self) -> int:
        return len(self.o)

    def part(self, k: Array) -> RaySet:
        """Some of the rays, by number or mask."""
        return RaySet(self.o[k], self.d[k], self.pixel[k])

    def options(self, k: int) -> str:
        """The options of `tracer validate` that show a ray again."""
        column, row = self.pixel[k]
        if column >= 0:
            return f"--pixel {column} {row}"
        numbers = " ".join(repr(float(x)) for x in (*self.o[k], *self.d[k]))
        return f"--ray {numbers}"


@dataclass(frozen=True)
class PictureRays(RaySet):
    """Rays of the pixels of a picture of another size than the scene's: `settings`, the options that give the
    scene that size."""

    settings: str

    def part(self, k: Array) -> PictureRays:
        """Some of the rays, by number or mask."""
        return PictureRays(self.o[k], self.d[k], self.pixel[k], self.settings)

    def options(self, k: int) -> str:
        """The options that show a pixel again."""
        return f"{self.settings} {super().options(k)}"


@dataclass(frozen=True)
class StepRays(RaySet):
    """Rays that are steps of chains: `first`: the rays that the chains began with, `events` (n,): the letters
    of each chain."""

    first: RaySet
    events: Array

    def options(self, k: int) -> str:
        """The options that show the whole chain again."""
        return f"{self.first.options(k)} --events {self.events[k]}"


def single(values: Array) -> Array:
    """The nearest single precision numbers, as doubles."""
    return np.asarray(values, np.float64).astype(np.float32).astype(np.float64)


def comparison_rays(scene: tracer.Scene, truth: Truth, count: int, seed: int) -> RaySet:
    """Half of the rays through pixels of the scene's picture (at most one a pixel), the rest free."""
    rng = np.random.default_rng([seed, 1])
    through = pixel_rays(scene, count // 2, rng)
    free = free_rays(scene, truth, count - len(through), rng)
    return RaySet(*(np.concatenate(pair) for pair in zip(_parts(through), _parts(free), strict=True)))


def _parts(rays: RaySet) -> tuple[Array, Array, Array]:
    return rays.o, rays.d, rays.pixel


def pixel_rays(scene: tracer.Scene, count: int, rng: np.random.Generator) -> RaySet:
    """Rays through pixels chosen at random, none twice."""
    width, height = scene.camera.resolution
    number = rng.permutation(width * height)[:count]
    pixel = np.stack([number % width, number // width], axis=1)
    offset = extended.pixel_offset(scene.camera, scene.literal)
    o, d = extended.camera_rays(scene.camera, pixel[:, 0] + offset, pixel[:, 1] + offset)
    return RaySet(single(extended.double(o)), single(extended.double(d)), pixel)


def free_rays(scene: tracer.Scene, truth: Truth, count: int, rng: np.random.Generator) -> RaySet:
    """Rays from anywhere around the shapes, one in four from inside a shape, aimed at or just past them."""
    centers, radii = balls(truth)
    if not len(centers):
        centers = np.array([extended.double(extended.camera_rays(scene.camera, [0.0], [0.0])[0][0])])
        radii = np.array([max(scene.camera.eye_distance, np.abs(centers).max())])
    low, high = (centers - radii[:, None]).min(axis=0), (centers + radii[:, None]).max(axis=0)
    middle, size = (low + high) / 2, (high - low).max()
    o = middle + size * rng.uniform(-1, 1, (count, 3))
    target = rng.integers(len(centers), size=count)
    inside = rng.uniform(size=count) < 0.25
    o[inside] = centers[target[inside]] + 0.8 * radii[target[inside], None] * in_ball(rng, int(inside.sum()))
    aim = centers[target] + 1.2 * radii[target, None] * in_ball(rng, count)
    d = np.where(rng.uniform(size=count)[:, None] < 0.8, aim - o, rng.normal(size=(count, 3)))
    _aim_at_silhouettes(truth, o, d, rng)
    d = np.where((d == 0).all(axis=1)[:, None], [1.0, 0.0, 0.0], d)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return RaySet(single(o), single(d), np.full((count, 2), -1))


def _aim_at_silhouettes(truth: Truth, o: Array, d: Array, rng: np.random.Generator) -> None:
    """Turns some rays, in place, to where they just touch a sphere."""
    spheres = truth.rows[truth.kind == SPHERE]
    if not len(spheres):
        return
    chosen = np.flatnonzero(rng.uniform(size=len(o)) < AT_SILHOUETTES)
    ball = spheres[rng.integers(len(spheres), size=len(chosen))]
    to_center = ball[:, :3] - o[chosen]
    distance = np.linalg.norm(to_center, axis=1)
    outside = distance > 1.01 * ball[:, 3]
    chosen, ball, to_center, distance = (a[outside] for a in (chosen, ball, to_center, distance))
    across = np.cross(to_center, rng.normal(size=(len(chosen), 3)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    radius = ball[:, 3] * (1 + 1e-4 * rng.uniform(-1, 1, len(chosen)))
    sine = radius / distance
    d[chosen] = np.sqrt(1 - sine**2)[:, None] * to_center / distance[:, None] + sine[:, None] * across


def balls(truth: Truth) -> tuple[Array, Array]:
    """Centers (k, 3) and radii (k,) of balls around the spheres and meshes."""
    centers, radii = [], []
    for number, kind in enumerate(truth.kind):
        if kind == SPHERE:
            centers.append(truth.rows[number, :3])
            radii.append(truth.rows[number, 3])
        elif kind == MESH:
            points = truth.corners[truth.first[number] : truth.first[number + 1]].reshape(-1, 3)
            center = (points.min(axis=0) + points.max(axis=0)) / 2
            centers.append(center)
            radii.append(np.linalg.norm(points - center, axis=1).max())
    return np.array(centers).reshape(-1, 3), np.array(radii)


def in_ball(rng: np.random.Generator, count: int) -> Array:
    """(n, 3) points spread evenly in the unit ball."""
    v = rng.normal(size=(count, 3))
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True) * rng.uniform(size=(count, 1)) ** (1 / 3))
