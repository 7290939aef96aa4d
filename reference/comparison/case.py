"""One scene in one precision: what several terms need of it, computed once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import InitVar, dataclass, field, replace
from functools import cached_property, wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np

import tracer
from reference import extended, mitsuba_scene
from reference.comparison.rays import RaySet, comparison_rays, single
from reference.comparison.truth import MESH, SPHERE, Truth
from reference.tolerances import EPSILON, TOLERANCES
from tracer.shapes import Sphere

Array = np.ndarray

P = ParamSpec("P")
R = TypeVar("R")

PIXELS = 40_000
"""Pixels of a picture that is compared, at most."""

HORIZON = TOLERANCES["horizon"].value
"""Planes that are hit farther away than this many extents S may be missed."""


class Bench:
    """What does not depend on the precision of our side: the scene with spheres rounded to single precision
    (all sides see the same numbers then, as meshes are rounded anyway), the same in a small picture, closed
    forms, Mitsuba, the rays."""

    def __init__(self, scene: tracer.Scene, rays: int, seed: int) -> None:
        self.scene = comparable(scene)
        self.small = small_picture(self.scene, min(rays, PIXELS))
        self.count, self.seed = rays, seed
        self.memory: dict[Any, Any] = {}

    @cached_property
    def truth(self) -> Truth:
        """The geometry for closed forms."""
        return Truth.of(self.scene)

    @cached_property
    def mitsuba(self) -> mitsuba_scene.MitsubaScene:
        """The scene in Mitsuba, one ray a pixel."""
        return mitsuba_scene.build(self.scene)

    @cached_property
    def rays(self) -> RaySet:
        """The rays that all terms of hits share."""
        return comparison_rays(self.scene, self.truth, self.count, self.seed)

    @cached_property
    def theirs(self) -> mitsuba_scene.Hits:
        """Mitsuba's hits of these rays."""
        return self.mitsuba.intersect(self.rays.o, self.rays.d)

    @staticmethod
    def ulps(error: Array, value: Array | None = None) -> Array:
        """Errors of Mitsuba in ulp of single precision of `value`, of 1 when left out."""
        return in_ulp(error, value, "single")


@dataclass
class Case:
    """A scene to compare in. `rays`: about how many; `backend`: ours (Mitsuba runs on LLVM); `words`: how a
    command line names the scene."""

    scene: tracer.Scene
    precision: str = "double"
    backend: str = "llvm"
    rays: int = 20_000
    seed: int = 0
    words: str = ""
    bench: Bench = field(init=False, repr=False)
    memory: dict[Any, Any] = field(init=False, repr=False, default_factory=dict)
    shared: InitVar[Bench | None] = None

    def __post_init__(self, shared: Bench | None) -> None:
        self.bench = shared or Bench(self.scene, self.rays, self.seed)

    def in_precision(self, precision: str) -> Case:
        """The same case in another precision; scene, rays and Mitsuba's side are shared."""
        return replace(self, precision=precision, shared=self.bench)

    def ulps(self, error: Array, value: Array | None = None) -> Array:
        """Errors of ours in ulp of our precision of `value`, of 1 when left out."""
        return in_ulp(error, value, self.precision)

    @property
    def epsilon(self) -> float:
        """Unit roundoff of our side."""
        return EPSILON[self.precision]

    @cached_property
    def ours(self) -> tracer.Hits:
        """Our hits of the rays of the bench."""
        return self.intersect(self.bench.rays)

    def intersect(self, rays: RaySet) -> tracer.Hits:
        """Our hits of other rays."""
        return tracer.intersect(
            self.bench.scene, rays.o, rays.d, precision=self.precision, backend=self.backend
        )

    @cached_property
    def same(self) -> Array:
        """Mask: both sides hit the same primitive, or both nothing."""
        theirs = self.bench.theirs
        return np.asarray((self.ours.shape == theirs.shape) & (self.ours.primitive == theirs.primitive))

    @cached_property
    def extents(self) -> Array:
        """(n,) S of each ray: the largest |coordinate| among the finite shapes, its origin and its hit."""
        return sizes(self.bench.truth, self.bench.rays.o, self.ours.position)


def once_a_case(make: Callable[Concatenate[Case, P], R]) -> Callable[Concatenate[Case, P], R]:
    """A function of a case (and plain arguments) whose result is kept with the case."""
    return _kept(make, lambda case: case.memory)


def once_a_scene(make: Callable[Concatenate[Case, P], R]) -> Callable[Concatenate[Case, P], R]:
    """The same where the result does not depend on our precision: kept for both."""
    return _kept(make, lambda case: case.bench.memory)


def _kept(
    make: Callable[Concatenate[Case, P], R], memory_of: Callable[[Case], dict[Any, Any]]
) -> Callable[Concatenate[Case, P], R]:
    @wraps(make)
    def kept(case: Case, *arguments: P.args, **named: P.kwargs) -> R:
        key, memory = (make, arguments, tuple(named.items())), memory_of(case)
        if key not in memory:
            memory[key] = make(case, *arguments, **named)
        result: R = memory[key]
        return result

    return kept


def in_ulp(error: Array, value: Array | None, precision: str) -> Array:
    """(n,) |error| in units of the last place of values, of 1 when left out."""
    dtype = np.float32 if precision == "single" else np.float64
    place = np.spacing(np.abs(np.ones(()) if value is None else value).astype(dtype)).astype(np.float64)
    return np.asarray(np.abs(error) / place)


def comparable(scene: tracer.Scene) -> tracer.Scene:
    """The scene as it stands still, with spheres placed, by the plain version, and rounded to single
    precision, but for those whose texture needs their own frame."""
    rows = Truth.of(scene).rows
    shapes = []
    for number, shape in enumerate(scene.shapes):
        if isinstance(shape, Sphere) and shape.texture_space != "object":
            *center, radius = single(rows[number]).tolist()
            placed = {"center": tuple(center), "radius": radius, "scale": 1.0, "rotate": (0.0,) * 3}
            shape = shape.model_copy(update=placed | {"translate": (0.0,) * 3})
        shapes.append(shape)
    return scene.model_copy(update={"shapes": shapes, "animation": []})


def small_picture(scene: tracer.Scene, pixels: int) -> tracer.Scene:
    """The scene with a picture of about so many pixels at most, without depth of field; the framing stays."""
    camera = scene.camera
    width, height = camera.resolution
    update: dict[str, Any] = {"depth_of_field": None}
    if width * height > pixels:
        scale = (pixels / (width * height)) ** 0.5
        resolution = (max(1, round(width * scale)), max(1, round(height * scale)))
        update["resolution"] = resolution
        if not camera.is_look_at:
            update["pixel_size"] = camera.pixel_size * width / resolution[0]
    return scene.model_copy(update={"camera": camera.model_copy(update=update)})


def sizes(truth: Truth, *points: Array) -> Array:
    """(n,) the largest |coordinate| among the finite shapes and some points (n, 3), NaN left out."""
    largest = [np.abs(np.nan_to_num(p, nan=0.0, posinf=0.0, neginf=0.0)).max(axis=1) for p in points]
    return np.maximum(np.max(largest, axis=0), truth.extent)


def truth_of_hits(truth: Truth, rays: RaySet, shape: Array, primitive: Array) -> tuple[Array, Array]:
    """t (n,) and outward normal (n, 3) of given hits, NaN on a miss, rounded to doubles once."""
    t, normal = np.full(len(rays), np.nan), np.full((len(rays), 3), np.nan)
    k = np.flatnonzero(shape >= 0)
    d = extended.unit(rays.d[k])
    exact_t, exact_n = truth.hit(rays.o[k], d, shape[k], primitive[k])
    t[k], normal[k] = extended.double(exact_t), extended.double(exact_n)
    return t, normal


def roundness(truth: Truth, shape: Array, primitive: Array) -> tuple[Array, Array]:
    """For hits (n,): the radius of a sphere, infinite for flat shapes; and how ill-conditioned a triangle is,
    |e1||e2| / |e1 x e2| of the edges at its first corner; 1 for planes and spheres."""
    radius, condition = np.full(len(shape), np.inf), np.ones(len(shape))
    ball = truth.kind[shape] == SPHERE
    radius[ball] = truth.rows[shape[ball], 3]
    mesh = np.flatnonzero(truth.kind[shape] == MESH)
    corners = truth.triangles(shape[mesh], primitive[mesh])
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.linalg.norm(np.cross(u, v), axis=1)
    condition[mesh] = np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1) / area
    return radius, condition
