"""Shapes that touch or cut each other: balls and cubes on floors, in floors, on each other; room corners of
planes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from reference.tolerances import EPSILON, TOLERANCES
from tests.accuracy.contact import Ball, Polytope, first_contact
from tests.accuracy.probe import bounce, compiled, directions, rotation
from tests.accuracy.worlds import cube

Array = np.ndarray
AXES = np.array([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1.0]])
FLOOR = 7.0
"""Half the edge of a floor made of triangles, in sizes."""


@dataclass
class Stage:
    """Shapes as in a scene file, the same as convex solids, points (n, 3) to aim at, and the direction of
    open space."""

    shapes: list[dict[str, Any]]
    solids: list[Any]
    targets: Array
    up: Array


@dataclass
class Place:
    """A random place: rotation, middle, size."""

    frame: Array
    center: Array
    size: float

    def world(self, points: Array) -> Array:
        """Points given in sizes."""
        return self.size * np.asarray(points, float) @ self.frame.T + self.center

    def floor(self, kind: str) -> tuple[dict[str, Any], Polytope]:
        """The floor y = 0, endless or two triangles."""
        n = self.frame[:, 1]
        solid = Polytope(n[None], np.array([n @ self.center]))
        if kind == "plane":
            return {"kind": "plane", "coefficients": [*n.tolist(), float(-n @ self.center)]}, solid
        corners = self.world(
            np.array([[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]]) * FLOOR + [0.7, 0, -0.3]
        )
        return {"kind": "mesh", "vertices": corners.tolist(), "faces": [[0, 1, 2, 3]]}, solid

    def ball(self, y: float, radius: float = 1.0) -> tuple[dict[str, Any], Ball]:
        """A ball over the middle."""
        center = self.world([0, y, 0])
        sphere = {"kind": "sphere", "center": center.tolist(), "radius": float(self.size * radius)}
        return sphere, Ball(center, self.size * radius)

    def box(self, y: float, deeper: float = 0.0) -> tuple[dict[str, Any], Polytope]:
        """A cube of half edge 1; the solid's bottom stands `deeper` below that of the mesh."""
        shape = cube()
        shape["vertices"] = self.world(np.array(shape["vertices"]) + [0, y, 0]).tolist()
        normals = AXES @ self.frame.T
        offsets = normals @ self.world([0, y, 0]) + self.size * (1 + deeper * (AXES[:, 1] < 0))
        return shape, Polytope(normals, offsets)


def near(rng: np.random.Generator, n: int) -> Array:
    """Distances from 1e-7 to 1e-1."""
    return 10 ** rng.uniform(-7, -1, n)


def ring(radius: Array, y: Array, rng: np.random.Generator) -> Array:
    """Points around the y axis."""
    angle = rng.uniform(0, 2 * np.pi, len(radius))
    return np.stack([radius * np.cos(angle), y, radius * np.sin(angle)], axis=1)


def ball_on_floor(kind: str, sunk: float) -> Callable[..., Stage]:
    def make(place: Place, rng: np.random.Generator, n: int) -> Stage:
        floor, half_space = place.floor(kind)
        shape, ball = place.ball(1 - sunk)
        circle, e, zero = np.sqrt(1 - (1 - sunk) ** 2), near(rng, n), np.zeros(n)
        on_ball = ring(np.sqrt(np.maximum(0, 1 - (e - (1 - sunk)) ** 2)), e, rng)
        targets = np.where(rng.integers(2, size=n)[:, None] > 0, ring(circle + e, zero, rng), on_ball)
        return Stage([floor, shape], [half_space, ball], place.world(targets), place.frame[:, 1])

    return make


def cube_on_floor(kind: str, sunk: float) -> Callable[..., Stage]:
    def make(place: Place, rng: np.random.Generator, n: int) -> Stage:
        floor, half_space = place.floor(kind)
        shape, box = place.box(1 - sunk, deeper=1.0)
        e, along, zero = near(rng, n), rng.uniform(-0.95, 0.95, n), np.zeros(n)
        on_floor = rng.integers(2, size=n)[:, None] > 0
        targets = np.where(on_floor, np.stack([1 + e, zero, along], 1), np.stack([1 + zero, e, along], 1))
        for axis in (0, 2):
            targets[:, axis] *= rng.choice([-1, 1], n)
        turn = rng.integers(2, size=n)[:, None] > 0
        targets = np.where(turn, targets[:, ::-1], targets)
        return Stage([floor, shape], [half_space, box], place.world(targets), place.frame[:, 1])

    return make


def ball_on_cube(height: float) -> Callable[..., Stage]:
    def make(place: Place, rng: np.random.Generator, n: int) -> Stage:
        block, box = place.box(0.0)
        shape, ball = place.ball(1 + 0.5 * height, 0.5)
        circle = 0.5 * np.sqrt(1 - height**2)
        targets = ring(circle + near(rng, n), np.ones(n), rng)
        return Stage([block, shape], [box, ball], place.world(targets), place.frame[:, 1])

    return make


def ball_on_ball(place: Place, rng: np.random.Generator, n: int) -> Stage:
    low, below = place.ball(0.0)
    high, above = place.ball(1.5, 0.5)
    e = near(rng, n)
    targets = place.world(ring(e, np.sqrt(1 - e**2), rng))
    return Stage([low, high], [below, above], targets, place.frame[:, 1])


def room_corner(place: Place, rng: np.random.Generator, n: int) -> Stage:
    solids = [Polytope(axis[None], np.array([axis @ place.center])) for axis in place.frame.T]
    shapes = [
        {"kind": "plane", "coefficients": [*solid.normals[0].tolist(), float(-solid.offsets[0])]}
        for solid in solids
    ]
    targets = np.stack([near(rng, n), near(rng, n), np.zeros(n)], axis=1)
    shift = rng.integers(3, size=n)
    targets = np.take_along_axis(targets, (np.arange(3) + shift[:, None]) % 3, axis=1)
    return Stage(shapes, solids, place.world(targets), place.frame.sum(axis=1))


STAGES: dict[str, Callable[..., Stage]] = {
    "ball on plane": ball_on_floor("plane", 0.0),
    "ball on mesh": ball_on_floor("mesh", 0.0),
    "ball half in plane": ball_on_floor("plane", 0.7),
    "ball half in mesh": ball_on_floor("mesh", 0.7),
    "ball deep in mesh": ball_on_floor("mesh", 1.6),
    "cube on plane": cube_on_floor("plane", 0.0),
    "cube on mesh": cube_on_floor("mesh", 0.0),
    "cube in plane": cube_on_floor("plane", 0.3),
    "cube in mesh": cube_on_floor("mesh", 0.3),
    "ball on cube": ball_on_cube(1.0),
    "ball in cube": ball_on_cube(-0.5),
    "ball on ball": ball_on_ball,
    "room corner": room_corner,
}


def check(name: str, trials: int, n: int, precision: str = "single") -> None:
    used_rays = doubtful = 0
    for trial in range(trials):
        rng = np.random.default_rng([trial, len(name)])
        size = 10 ** rng.uniform(-2, 2)
        place = Place(rotation(rng), rng.uniform(-3, 3, 3) * size, size)
        stage = STAGES[name](place, rng, n)
        d_in, d_out = directions(rng, n), directions(rng, n)
        d_in *= -np.sign(d_in @ stage.up)[:, None]
        o = stage.targets - 3 * size * d_in
        found = bounce(compiled({"shapes": stage.shapes}, precision), o, d_in, d_out, False, 100 * size)
        extent = np.abs(place.center).max() + 2 * FLOOR * size
        doubt = TOLERANCES["distance"].value * EPSILON["single"] * extent
        truth = first_contact(stage.solids, found.shape, False, found.p, d_out, doubt, size)
        arrival = np.abs((found.outward * d_in).sum(axis=1))
        used = found.valid & found.entering & (arrival > TOLERANCES["arrival cosine"].value)
        used &= (found.outward * d_out).sum(axis=1) > 1e-3
        for solid in stage.solids:
            enters, leaves = solid.interval(o, d_in, doubt)
            used &= (enters > 0) | (leaves < 0)
        at = (found.p + np.where(truth.solid >= 0, truth.t, 0)[:, None] * d_out - place.center) @ place.frame
        used &= (truth.solid != 0) | (np.abs(at[:, [0, 2]]).max(axis=1) < (FLOOR - 1) * size)
        used_rays, doubtful = used_rays + used.sum(), doubtful + (used & ~truth.certain).sum()
        used &= truth.certain
        same = used & (found.next_shape == truth.solid)
        with np.errstate(invalid="ignore"):
            error = np.abs(found.t - truth.t) * truth.cosine / (EPSILON["single"] * extent)
        steep = same & (truth.solid >= 0) & (truth.cosine > 0.05)
        wrong = used & ~same | steep & (np.where(steep, error, 0) > TOLERANCES["contact distance"].value)
        if wrong.any():
            k = int(np.argmax(wrong))
            pytest.fail(
                f"{int(wrong.sum())} of {int(used.sum())} rays are wrong; trial {trial}, size {size}: a "
                f"ray leaves shape "
                f"{found.shape[k]} at {found.p[k].tolist()} along {d_out[k].tolist()} and meets shape "
                f"{found.next_shape[k]} at {found.t[k]}; truth: {truth.solid[k]} at {truth.t[k]}"
            )
    assert used_rays > 0.08 * trials * n
    assert doubtful <= TOLERANCES["doubtful"].value * used_rays


@pytest.mark.parametrize("name", STAGES)
def test_shapes_in_contact(name: str) -> None:
    check(name, trials=2, n=5000)


@pytest.mark.slow
@pytest.mark.parametrize("name", STAGES)
def test_shapes_in_contact_at_many_places(name: str) -> None:
    check(name, trials=8, n=20_000)


@pytest.mark.parametrize("name", ["cube in mesh", "ball deep in mesh", "room corner"])
def test_shapes_in_contact_in_double_precision(name: str) -> None:
    check(name, trials=1, n=5000, precision="double")
