"""The hierarchy over many spheres: every ray has the same answers as when all spheres are asked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
import pytest

import tracer
from tests.accuracy import worlds
from tests.accuracy.probe import directions, unit
from tests.unit.node_lists import (
    Lists,
    boxes_too_small,
    damaged,
    jump_too_far,
    leaf_one_short,
    planes_swapped,
)
from tracer import device_shapes
from tracer.acceleration import layout
from tracer.backends import INVALID, Backend, exact_arithmetic, find_backend
from tracer.ray import Ray, Segment, no_hit, normalize
from tracer.shapes import sphere_table
from tracer.shapes.sphere import SphereSlot
from tracer.shapes.sphere_table import SphereTable, sphere_boxes

Array = np.ndarray
PRECISIONS = ["single", "double"]


# ---- Heaps of spheres (n, 4): center, radius ---------------------------------------------------------------


def soup(seed: int, count: int, decades: float = 2.0) -> Array:
    """Spheres of all sizes in a cube of edge 2: overlapping, touching nothing, inside each other."""
    rng = np.random.default_rng(seed)
    radius = 0.3 * 10.0 ** rng.uniform(-decades, 0, count)
    return np.column_stack([rng.uniform(-1, 1, (count, 3)), radius])


def nested(seed: int) -> Array:
    """Shells around each other: with one center, with one common point, and close together."""
    rng = np.random.default_rng(seed)
    radius = 1 / np.arange(1, 31)
    same = np.column_stack([np.tile(rng.uniform(-1, 1, 3), (30, 1)), radius])
    touching = np.column_stack([np.outer(1 - radius, unit(rng.normal(size=3))) + 2.0, radius])
    close = np.column_stack([np.tile(rng.uniform(-1, 1, 3), (30, 1)), 0.5 + 1e-6 * np.arange(30)])
    return np.concatenate([same, touching, close])


def packed(seed: int) -> Array:
    """Balls on a grid that touch their neighbors, and some of them twice."""
    balls = np.column_stack(
        [np.stack(np.meshgrid(*[np.arange(5.0)] * 3), axis=-1).reshape(-1, 3), np.full(125, 0.5)]
    )
    return np.concatenate([balls, balls[seed % 3 :: 3]])


def flat(seed: int) -> Array:
    spheres = soup(seed, 90)
    spheres[:, seed % 3] = 0.25
    return spheres


HEAPS: dict[str, Callable[[int], Array]] = {
    "soup": lambda seed: soup(seed, 300),
    "dust": lambda seed: soup(seed, 500, 5.0),
    "few": lambda seed: soup(seed, 3),
    "one": lambda seed: soup(seed, 1),
    "nested": nested,
    "packed": packed,
    "the same": lambda seed: np.repeat(soup(seed, 2), 40, axis=0),
    "flat": flat,
    "huge": lambda seed: soup(seed, 100) * 1e15,
    "tiny": lambda seed: soup(seed, 100) * 1e-15,
    "far": lambda seed: soup(seed, 200) + [300, -500, 800, 0],
    "on a planet": lambda seed: np.concatenate(
        [soup(seed, 100), [[0, -1e5, 0, 1e5 - 1], [3e4, 0, 2e4, 9e3]]]
    ),
    "scales": lambda seed: np.concatenate([soup(seed + k, 40) * 10.0**-k for k in range(5)]),
}


# ---- Rays that are hard to decide --------------------------------------------------------------------------


@dataclass
class Way:
    """n rays as NumPy has them: origins, directions, departure words; and points that lights stand at."""

    o: Array
    d: Array
    word: Array
    light: Array

    @property
    def n(self) -> int:
        """How many rays."""
        return len(self.o)


def ways(heap: Array, seed: int, n: int, backend: Backend) -> Way:
    """Free rays at, past and from within spheres, and rays that leave a sphere."""
    rng = np.random.default_rng(seed)
    number = rng.integers(len(heap), size=n)
    center, radius = heap[number, :3], heap[number, 3]
    size = np.ptp(heap[:, :3], axis=0).max() + heap[:, 3].max()
    d = directions(rng, n)
    along = rng.integers(3, size=n)
    straight = np.where(
        np.arange(3) == along[:, None], rng.choice([-1.0, 1.0], (n, 1)), rng.choice([0.0, -0.0], (n, 3))
    )
    axes = rng.integers(3, size=n)[:, None] == 0
    d = np.where(axes, straight, d)
    # Aimed at the silhouette but for a little (along an axis: most often where a box ends), or anywhere.
    to_face = axes & (rng.integers(4, size=(n, 1)) > 0)
    across = np.where(to_face, np.roll(straight, 1, axis=1), unit(np.cross(d, directions(rng, n))))
    little = rng.choice([-1, 0, 1], n) * 10.0 ** rng.uniform(-9, -1, n)
    offset = np.where(rng.integers(2, size=n) > 0, 1 + little, rng.uniform(0, 1, n))
    kind = rng.integers(4, size=n)
    away = np.where(kind == 0, rng.uniform(-1, 1, n) * radius, size * 10.0 ** rng.uniform(-3, 0.5, n))
    o = center + across * (offset * radius)[:, None] - d * away[:, None]
    word = np.full(n, INVALID, np.uint32)
    # From the surface of a sphere, tangent or not, on either side, as the tracer makes such rays.
    leaves = kind == 1
    normal = directions(rng, n)
    o[leaves] = surface_points(backend, heap[number], normal)[leaves]
    tangent = unit(np.cross(normal, directions(rng, n)) + normal * little[:, None])
    d[leaves] = np.where(rng.integers(2, size=n)[:, None] > 0, tangent, d)[leaves]
    inside = (d * normal).sum(axis=1) < 0
    word[leaves] = (2 * number + inside)[leaves]
    # From the surface of something else next to a sphere, and within it by rounding.
    beside = kind == 2
    o[beside] = (center + normal * (radius * (1 + little * 1e-3))[:, None])[beside]
    word[beside] = 2 * len(heap) + (inside[beside])
    other = heap[rng.integers(len(heap), size=n)]
    light = (
        other[:, :3] + directions(rng, n) * (other[:, 3] * rng.choice([0, 1, 1 + 1e-6, 1.5, 50], n))[:, None]
    )
    return Way(o, d, word, light)


def surface_points(backend: Backend, rows: Array, normal: Array) -> Array:
    row = backend.Vector4(*(column(backend, c) for c in rows.T))
    center = backend.Vector3(row.x, row.y, row.z)
    p, _ = SphereSlot.surface(row, dr.fma(row.w, vectors(backend, normal), center))
    return p.numpy().T.astype(np.float64)


def column(backend: Backend, values: Array) -> Any:
    return backend.Float(np.ascontiguousarray(values, backend.dtype))


def vectors(backend: Backend, values: Array) -> Any:
    return backend.Vector3(*(column(backend, c) for c in values.T))


# ---- The answers -------------------------------------------------------------------------------------------


@dataclass
class Answers:
    """Of n rays: nearest distance and primitive; of the ways to lights: whether one is blocked, and a sum
    over all surfaces that they cross, of whole numbers that tell the spheres apart."""

    t: Array
    primitive: Array
    blocked: Array
    crossed: Array

    def different(self, other: Answers) -> Array:
        """Mask of the rays that have other answers, to the last bit."""
        return (
            (self.t != other.t)
            | (self.primitive != other.primitive)
            | (self.blocked != other.blocked)
            | (self.crossed != other.crossed)
        )


def one_after_the_other(
    table: SphereTable, ray: Ray, limit: Any, state: Any, active: Any, step: Any, done: Any = None
) -> Any:
    """In place of `SphereTable._visit`: all spheres, no boxes."""
    n = table.backend.opaque_id(dr.width(table.spheres.primitives))
    slot = dr.select(active, dr.zeros(table.backend.UInt32, dr.width(active)), n)
    _, state = dr.while_loop(
        state=(slot, state),
        cond=lambda slot, state: slot < n,
        body=lambda slot, state: (slot + 1, step(state, table.fetch(slot))),
    )
    return state


def ask(table: SphereTable, way: Way) -> Answers:
    backend = table.backend
    with exact_arithmetic():
        o = vectors(backend, way.o)
        words = backend.UInt32(way.word)
        sides = dr.zeros(backend.UInt32, way.n)
        ray = Ray(o, normalize(vectors(backend, way.d)), words, sides, None)
        active = backend.Bool(np.arange(way.n) % 7 != 0)
        hit = table.closest(ray, no_hit(backend, way.n), active)
        light = vectors(backend, way.light)
        length = dr.sqrt(dr.squared_norm(light - o))
        to_light = Ray(o, (light - o) * dr.rcp(length), words, sides, None)
        segment = Segment(to_light, length, light, sides, sides)
        blocked = table.blocks(segment, active)
        crossed = table.fold(
            segment,
            state=dr.zeros(backend.UInt32, way.n),
            active=active,
            step=lambda total, sphere: (
                total
                + backend.UInt32(sphere.crossings(segment, active)) * (2654435761 * (sphere.primitive + 1))
            ),
            done=lambda total: total != total,
        )
        dr.eval(hit, blocked, crossed)
    return Answers(hit.t.numpy(), hit.primitive.numpy(), blocked.numpy() & active.numpy(), crossed.numpy())


def check(heap: Array, seed: int, n: int, precision: str) -> Answers:
    """Every ray has the same answers, bit for bit; those of all spheres."""
    backend = find_backend("llvm", precision)
    heap = np.asarray(heap, backend.dtype).astype(np.float64)
    primitives = np.random.default_rng(seed).permutation(len(heap))
    way = ways(heap[np.argsort(primitives)], seed, n, backend)
    with exact_arithmetic():
        table = SphereTable.of(backend, heap, primitives)
    found = ask(table, way)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SphereTable, "_visit", one_after_the_other)
        all_asked = ask(table, way)
    wrong = found.different(all_asked)
    k = int(np.argmax(wrong))
    assert not wrong.any(), (
        f"{int(wrong.sum())} of {n}: from {way.o[k]} along {way.d[k]}, word {way.word[k]}, to {way.light[k]}"
    )
    return all_asked


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("name", HEAPS)
def test_answers_are_those_of_all_spheres(name: str, precision: str, form: str) -> None:
    found = check(HEAPS[name](1), 2, 6000, precision)
    assert 0.1 < (found.primitive != INVALID).mean() < 0.9
    assert 0.02 < found.blocked.mean() < 0.9
    assert (found.crossed > 0).mean() > 0.02
    assert (found.t == 0).mean() > 0.001


@pytest.mark.slow
@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("name", HEAPS)
def test_answers_are_those_of_all_spheres_in_many_heaps(name: str, precision: str, form: str) -> None:
    for seed in range(10, 20):
        check(HEAPS[name](seed), seed, 50_000, precision)


# ---- Planted errors ----------------------------------------------------------------------------------------


def boxes_not_widened(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(layout, "find_grid", lambda tree: None)
    patch.setattr(sphere_table, "WIDTH", 0)


def lists_damaged(damage: Callable[[Lists], None]) -> Callable[[pytest.MonkeyPatch], None]:
    def plant(patch: pytest.MonkeyPatch) -> None:
        patch.setattr(sphere_table, "threaded", damaged(damage))

    return plant


def nearest_stops_at_any(patch: pytest.MonkeyPatch) -> None:
    visit = SphereTable._visit

    def hasty(
        table: SphereTable, ray: Ray, limit: Any, state: Any, active: Any, step: Any, done: Any = None
    ) -> Any:
        done = done or (lambda hit: hit.valid)
        return visit(table, ray, limit, state, active, step, done)

    patch.setattr(SphereTable, "_visit", hasty)


@pytest.mark.parametrize(
    "plant",
    [
        boxes_not_widened,
        nearest_stops_at_any,
        *map(lists_damaged, (jump_too_far, boxes_too_small, planes_swapped, leaf_one_short)),
    ],
)
def test_planted_error_is_caught(
    plant: Callable[[pytest.MonkeyPatch], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    plant(monkeypatch)
    with pytest.raises(AssertionError):
        check(HEAPS["tiny"](1), 2, 40_000, "single")


# ---- Scenes ------------------------------------------------------------------------------------------------


def scene_of(heap: Array, **keys: Any) -> tracer.Scene:
    spheres = [{"kind": "sphere", "center": row[:3].tolist(), "radius": float(row[3])} for row in heap]
    return tracer.load({"shapes": spheres} | keys)


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("name", ["soup", "packed"])
def test_the_order_in_the_file_makes_no_difference(name: str, precision: str) -> None:
    """Of equal distances the lower shape counts; what is hit, and where, is the same in any order."""
    heap = HEAPS[name](4)
    way = ways(heap, 3, 10_000, find_backend("llvm", precision))
    d = np.where(way.d == 0, 0.0, way.d)
    first = tracer.intersect(scene_of(heap), way.o, d, precision=precision)
    lowest = {row.tobytes(): k for k, row in reversed(list(enumerate(heap)))}
    rng = np.random.default_rng(5)
    for _ in range(2):
        order = rng.permutation(len(heap))
        again = tracer.intersect(scene_of(heap[order]), way.o, d, precision=precision)
        assert np.array_equal(first.t, again.t)
        hit = first.valid
        mine, theirs = heap[first.shape[hit]], heap[order[again.shape[hit]]]
        # Another sphere at the same distance only where two meet.
        at = first.position[hit]
        apart = np.abs(np.linalg.norm(at - theirs[:, :3], axis=1) - theirs[:, 3])
        assert apart.max() < {"single": 1e-5, "double": 1e-14}[precision] * np.abs(heap).max()
        assert np.array_equal([lowest[row.tobytes()] for row in mine], first.shape[hit])


@pytest.mark.parametrize("transparent", [False, True])
def test_a_picture_is_that_of_spheres_one_by_one(transparent: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    table = worlds.FEATURES["many spheres"]() | {"transparent_shadows": transparent}
    table["shapes"] = [shape for shape in table["shapes"] if shape["kind"] == "sphere"][:32]
    few = tracer.render(tracer.load(table), aovs="all")
    monkeypatch.setattr(device_shapes, "UNROLLED_SPHERES", 0)
    many = tracer.render(tracer.load(table), aovs="all")
    assert many.stats["rays"] == few.stats["rays"]
    for name in many.aovs:
        assert many.aovs[name].tobytes() == few.aovs[name].tobytes()
    if transparent:  # factors of light come in another order
        assert np.abs(many.color - few.color).max() < 1e-6
    else:
        assert many.color.tobytes() == few.color.tobytes()


def test_boxes_hold_their_spheres() -> None:
    heap = np.concatenate([make(7) for make in HEAPS.values()])
    lower, upper = (box.astype(np.float64) for box in sphere_boxes(heap))
    center, radius = heap[:, :3].astype(np.longdouble), heap[:, 3:].astype(np.longdouble)
    assert (lower <= center - radius).all() and (upper >= center + radius).all()
    ulp = np.spacing(np.maximum(np.abs(lower), np.abs(upper)).astype(np.float32))
    assert (upper - lower - 2 * radius <= 4 * ulp).all()
