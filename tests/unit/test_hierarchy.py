"""The hierarchy over triangles: its form, its layout for kernels, and the same nearest hits as without it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

import tracer
from tests.accuracy.probe import directions, rotation, unit
from tests.accuracy.worlds import icosphere
from tests.unit.node_lists import (
    Lists,
    boxes_too_small,
    damaged,
    jump_too_far,
    leaf_one_short,
    planes_swapped,
)
from tracer import device_meshes
from tracer.acceleration import grid, layout, traverse
from tracer.acceleration.build import Hierarchy, build_hierarchy
from tracer.acceleration.contraction import WORTH, worth_testing
from tracer.acceleration.grid import find_grid
from tracer.acceleration.layout import LEAF, OCTANTS, threaded
from tracer.acceleration.subtrees import LARGEST_LEAF, LARGEST_SUBTREE, NODE_COST
from tracer.backends import find_backend, thread_count

Array = np.ndarray


def soup(seed: int, count: int, size: float = 0.3) -> Array:
    """Triangles (m, 3, 3) in a cube of edge 2, in single precision numbers."""
    rng = np.random.default_rng(seed)
    sizes = size * 10.0 ** rng.uniform(-2, 0, (count, 1, 1))
    return single(rng.uniform(-1, 1, (count, 1, 3)) + sizes * rng.normal(size=(count, 3, 3)))


def single(corners: Array) -> Array:
    return corners.astype(np.float32).astype(np.float64)


def flat(axis: int) -> Array:
    corners = soup(3, 100)
    corners[..., axis] = 0.25
    return corners


def sorted_apart() -> Array:
    """Distances that double from one triangle to the next: as unbalanced as a tree can be."""
    return single(soup(5, 200) * 1e-3 + 2.0 ** np.arange(-100, 100)[:, None, None])


MESHES: dict[str, Callable[[], Array]] = {
    "one": lambda: soup(1, 1),
    "two": lambda: soup(1, 2),
    "three": lambda: soup(1, 3),
    "leaf and one": lambda: soup(1, LARGEST_LEAF + 1),
    "soup": lambda: soup(2, 1000),
    "same triangle": lambda: np.repeat(soup(1, 1), 50, axis=0),
    "pairs": lambda: np.repeat(soup(1, 40), 2, axis=0),
    "same centroid": lambda: single(np.arange(1, 31)[:, None, None] * [[1.0, 0, 0], [-1, 1, 0], [0, -1, 0]]),
    "points": lambda: np.repeat(soup(4, 60)[:, :1], 3, axis=1),
    "one point": lambda: np.full((20, 3, 3), 0.5),
    "collinear": lambda: single(np.arange(90).reshape(30, 3)[..., None] * np.array([0.1, 0.2, -0.3])),
    **{f"flat in {'xyz'[axis]}": partial(flat, axis) for axis in range(3)},
    "huge": lambda: single(soup(2, 200) * 1e30),
    "tiny": lambda: single(soup(2, 200) * 1e-30),
    "smallest": lambda: single(soup(2, 200) * 1e-44),
    "far": lambda: single(soup(2, 200) + 1e6),
    "doubling": sorted_apart,
    "icosphere": lambda: single((lambda mesh: mesh[0][mesh[1]])(icosphere(3))),
    # Beyond a small subtree, where nodes are cut by other kernels.
    "subtree": lambda: soup(8, LARGEST_SUBTREE),
    "subtree and one": lambda: soup(8, LARGEST_SUBTREE + 1),
    "two chunks and one": lambda: soup(8, 2 * LARGEST_SUBTREE + 1),
    "same triangle often": lambda: np.repeat(soup(1, 1), 2 * LARGEST_SUBTREE + 3, axis=0),
    "same centroid often": lambda: single(
        np.arange(1, 601)[:, None, None] * [[1.0, 1, 1], [-1, 0, 1], [0, -1, -1]]
    ),
    "two places": lambda: np.repeat(soup(1, 2), [700, 300], axis=0),
    "one far away": lambda: single(np.concatenate([soup(2, 500), soup(2, 1) + 1e6])),
    "stack of walls": lambda: single(
        np.concatenate([soup(k, 60) * [1, 1, 0] + [0, 0, k] for k in range(12)])
    ),
    "huge, large": lambda: single(soup(2, 500) * 1e37),
    "smallest, large": lambda: single(soup(2, 500) * 1e-44),
    "zero": lambda: np.zeros((300, 3, 3)),
}


def built(name: str) -> tuple[Array, Hierarchy]:
    corners = MESHES[name]()
    return corners, build_hierarchy(find_backend(), corners)


def lists(tree: Hierarchy) -> Lists:
    return Lists.of(threaded(find_backend(), tree))


@pytest.mark.parametrize("name", MESHES)
def test_each_triangle_is_in_one_leaf(name: str) -> None:
    corners, tree = built(name)
    leaves = np.flatnonzero(tree.left == 0)
    places = np.concatenate([np.arange(tree.first[k], tree.first[k] + tree.count[k]) for k in leaves])
    assert np.array_equal(np.sort(places), np.arange(len(corners)))
    assert np.array_equal(np.sort(tree.order), np.arange(len(corners)))
    assert tree.count[leaves].min() >= 1
    assert tree.count[leaves].max() <= LARGEST_LEAF <= 7  # what three bits of the layout hold


@pytest.mark.parametrize("name", MESHES)
def test_boxes_hold_children_and_triangles_and_are_tight(name: str) -> None:
    corners, tree = built(name)
    for node in range(len(tree.left)):
        own = corners[tree.order[tree.first[node] : tree.first[node] + tree.count[node]]].reshape(-1, 3)
        assert np.array_equal(tree.lower[node], own.min(axis=0))
        assert np.array_equal(tree.upper[node], own.max(axis=0))
    inner = np.flatnonzero(tree.left)
    children = tree.left[inner]
    assert np.array_equal(tree.count[inner], tree.count[children] + tree.count[children + 1])
    assert np.array_equal(tree.first[children], tree.first[inner])
    assert np.array_equal(tree.first[children + 1], tree.first[inner] + tree.count[children])


@pytest.mark.parametrize("name", MESHES)
def test_parents_come_first_and_levels_end_where_they_say(name: str) -> None:
    _, tree = built(name)
    inner = np.flatnonzero(tree.left)
    children = np.concatenate([tree.left[inner], tree.left[inner] + 1])
    assert np.array_equal(np.sort(children), np.arange(1, len(tree.left)))
    depth = np.zeros(len(tree.left), int)
    for node in inner:
        assert tree.left[node] > node
        depth[tree.left[node] : tree.left[node] + 2] = depth[node] + 1
    assert np.array_equal(np.cumsum(np.bincount(depth)), tree.levels)


def test_the_tree_is_not_deep() -> None:
    assert len(built("soup")[1].levels) <= 25
    assert len(built("same triangle")[1].levels) <= 6
    assert len(built("doubling")[1].levels) <= 60


def test_large_nodes_of_equal_centroids_are_halved() -> None:
    assert len(built("same triangle often")[1].levels) <= 9
    assert len(built("zero")[1].levels) <= 9


def bytes_of(tree: Hierarchy) -> bytes:
    parts = (tree.lower, tree.upper, tree.left, tree.first, tree.count, tree.order)
    return b"".join(np.ascontiguousarray(part).tobytes() for part in parts)


def test_every_run_thread_count_and_precision_gives_the_same_tree() -> None:
    corners = soup(11, 3000)
    first = bytes_of(build_hierarchy(find_backend("llvm"), corners))
    for threads in (1, 2, 3):
        with thread_count(threads):
            for precision in ("single", "double"):
                backend = find_backend("llvm", precision)
                assert bytes_of(build_hierarchy(backend, corners)) == first


def half_area(boxes: Array) -> Array:
    """Half of the areas of boxes (..., 2, 3)."""
    x, y, z = np.moveaxis(boxes[..., 1, :] - boxes[..., 0, :], -1, 0)
    return x * y + y * z + z * x


def expected_cost(tree: Hierarchy) -> float:
    """Node visits and triangle tests of a ray that meets the root, by the surface area heuristic."""
    areas = half_area(np.stack([tree.lower, tree.upper], axis=1).astype(float))
    return float((areas * np.where(tree.left > 0, NODE_COST, tree.count)).sum() / areas[0])


def plain_cost(boxes: Array) -> float:
    """The same times the root's area for triangles with `boxes` (n, 2, 3), cut the plain way: node by node,
    every cut between two of 16 bins on each axis tried."""
    n, area = len(boxes), half_area(np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)]))
    center = boxes.mean(axis=1)
    low, size = center.min(axis=0), np.ptp(center, axis=0)
    least, best = np.inf, np.arange(n) < n // 2
    for axis in np.flatnonzero(size > 0):
        bins = np.minimum(np.floor((center[:, axis] - low[axis]) * (16 / size[axis])), 15)
        for place in range(1, 16):
            sides = [boxes[bins < place], boxes[bins >= place]]
            if min(map(len, sides)) == 0:
                continue
            tops = [np.stack([side[:, 0].min(axis=0), side[:, 1].max(axis=0)]) for side in sides]
            cost = sum(len(side) * float(half_area(top)) for side, top in zip(sides, tops, strict=True))
            if cost < least:
                least, best = cost, bins < place
    if n == 1 or (n <= LARGEST_LEAF and least + NODE_COST * area >= n * area):
        return float(n * area)
    return NODE_COST * float(area) + plain_cost(boxes[best]) + plain_cost(boxes[~best])


@pytest.mark.parametrize(
    "name", ["soup", "far", "icosphere", "pairs", "stack of walls", "two chunks and one"]
)
def test_the_tree_is_as_good_as_one_cut_node_by_node(name: str) -> None:
    """Rounding may send a triangle to the next bin, or decide between two cuts that cost the same."""
    corners, tree = built(name)
    boxes = np.stack([corners.min(axis=1), corners.max(axis=1)], axis=1)
    root = half_area(np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)]))
    assert expected_cost(tree) == pytest.approx(plain_cost(boxes) / root, rel=0.02)


@pytest.mark.parametrize("name", MESHES)
def test_nodes_are_left_out_whose_boxes_fill_most_of_the_one_above(name: str) -> None:
    _, tree = built(name)
    kept = worth_testing(tree)
    area = half_area(np.stack([tree.lower, tree.upper], axis=1).astype(float))
    above = np.zeros(len(tree.left), int)  # the nearest kept node
    for node in np.flatnonzero(tree.left):
        above[tree.left[node] : tree.left[node] + 2] = node if kept[node] else above[node]
    inner = np.flatnonzero(tree.left)[1:]
    assert kept[0] and kept[tree.left == 0].all()
    assert np.array_equal(kept[inner], area[inner] <= WORTH * area[above[inner]])


@pytest.mark.parametrize("name", ["soup", "icosphere", "stack of walls", "two chunks and one"])
def test_fewer_boxes_are_tested_without_them(name: str) -> None:
    """Expected for a ray that meets the root: each node is tested when the nearest kept one above is met."""
    _, tree = built(name)
    area = half_area(np.stack([tree.lower, tree.upper], axis=1).astype(float))

    def tests(kept: Array) -> float:
        total, above = area[0], area.copy()
        for node in np.flatnonzero(tree.left):
            for child in (tree.left[node], tree.left[node] + 1):
                total += above[node] if kept[child] else 0
                above[child] = area[child] if kept[child] else above[node]
        return float(total / area[0])

    assert tests(worth_testing(tree)) < 0.97 * tests(np.full(len(tree.left), True))


def walked(nodes: Lists, octant: int, crosses: Callable[[int], bool]) -> list[int]:
    """The nodes that a kernel visits, by place in the table."""
    count = len(nodes.link) // OCTANTS
    node, end, visited = octant * count, (octant + 1) * count, []
    while node < end:
        visited.append(node)
        goes_on = crosses(node) or nodes.link[node] >= LEAF
        node = node + 1 if goes_on else int(nodes.link[node])
    assert node == end
    return visited


@pytest.mark.parametrize("name", MESHES)
def test_a_walk_through_all_boxes_meets_each_leaf_once(name: str, form: str) -> None:
    corners, tree = built(name)
    nodes, count = lists(tree), int(worth_testing(tree).sum())
    assert len(nodes.link) == OCTANTS * count
    for octant in range(OCTANTS):
        visited = walked(nodes, octant, lambda _: True)
        assert visited == list(range(octant * count, (octant + 1) * count))
        assert sorted(nodes.slots(visited)) == list(range(len(corners)))


@pytest.mark.parametrize("name", MESHES)
def test_a_walk_that_misses_the_root_ends_there(name: str, form: str) -> None:
    _, tree = built(name)
    nodes, count = lists(tree), int(worth_testing(tree).sum())
    for octant in range(OCTANTS):
        visited = walked(nodes, octant, lambda _: False)
        assert visited == [octant * count + k for k in range(1 if tree.left[0] else len(visited))]


@pytest.mark.parametrize("name", ["leaf and one", "flat in y", "doubling", "pairs"])
def test_a_missed_box_is_left_out_with_all_below_it_and_nothing_else(name: str, form: str) -> None:
    """Any one box missed: the triangles below it are left out, in every octant."""
    corners, tree = built(name)
    nodes = lists(tree)
    found = layout.find_grid(tree)
    lower, upper = (tree.lower, tree.upper) if found is None else (found.lower, found.upper)
    rng = np.random.default_rng(1)
    for node in rng.choice(np.flatnonzero(worth_testing(tree)), size=4):
        left_out = np.zeros(len(corners), bool)
        for other in np.flatnonzero(((lower == lower[node]) & (upper == upper[node])).all(axis=1)):
            left_out[tree.first[other] : tree.first[other] + tree.count[other]] = True
        for octant in range(OCTANTS):
            negative = np.array([octant >> k & 1 for k in range(3)], bool)
            first = np.where(negative, upper[node], lower[node])
            last = np.where(negative, lower[node], upper[node])
            missed = (nodes.first == first).all(axis=1) & (nodes.last == last).all(axis=1)
            visited = walked(nodes, octant, lambda k, missed=missed: not missed[k])
            slots = nodes.slots([k for k in visited if not missed[k]])
            assert np.array_equal(np.sort(slots), np.flatnonzero(~left_out))


def test_rays_of_an_octant_meet_the_nearer_child_first(form: str) -> None:
    """Two heaps far apart: whichever an octant's rays meet first comes first in its list."""
    for axis in range(3):
        corners = single(np.concatenate([soup(1, 20), soup(2, 20) + 10.0 * np.eye(3)[axis]]))
        tree = build_hierarchy(find_backend(), corners)
        nodes = lists(tree)
        middle = (nodes.first[0, axis] + nodes.last[0, axis]) / 2
        for octant in range(OCTANTS):
            second = octant * (len(nodes.link) // OCTANTS) + 1
            near_origin = min(nodes.first[second, axis], nodes.last[second, axis]) < middle
            assert near_origin == (octant >> axis & 1 == 0)


@pytest.mark.parametrize("name", MESHES)
def test_boxes_on_the_grid_hold_the_boxes_and_are_a_step_larger_at_most(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(grid, "ROOM", 0)
    _, tree = built(name)
    found = find_grid(tree)
    assert found is not None
    assert np.array_equal(found.low, found.low.astype(np.float32))
    assert np.array_equal(found.step, found.step.astype(np.float32))
    assert found.lower.max() <= grid.STEPS and found.upper.max() <= grid.STEPS
    low, high = found.low + found.lower * found.step, found.low + found.upper * found.step
    rounding = 4e-16 * (np.abs(low) + np.abs(high) + np.abs(found.low))
    assert (low <= tree.lower).all() and (tree.lower <= low + 1.001 * found.step + rounding).all()
    assert (high >= tree.upper).all() and (tree.upper >= high - 1.001 * found.step - rounding).all()


def test_small_details_in_a_huge_scene_keep_their_boxes() -> None:
    """On the grid a thousand triangles would share a few steps."""
    detailed = soup(2, 1000) * 1e-5
    far = soup(3, 4) * 1e2
    assert find_grid(build_hierarchy(find_backend(), soup(2, 1000))) is not None
    assert find_grid(build_hierarchy(find_backend(), single(np.concatenate([detailed, far])))) is None


# ---- Nearest hits ------------------------------------------------------------------------------------------


def scene_of(corners: Array) -> tracer.Scene:
    faces = np.arange(3 * len(corners)).reshape(-1, 3).tolist()
    return tracer.load(
        {"shapes": [{"kind": "mesh", "vertices": corners.reshape(-1, 3).tolist(), "faces": faces}]}
    )


def nearest(corners: Array, o: Array, d: Array) -> tuple[Array, Array, Array]:
    """By every triangle's test (Moeller, Trumbore, 1997) in double precision: distances, triangles (-1:
    none), and mask of the rays whose answer no rounding can change.

    A ray is clear when it passes all triangles that could count well inside or outside of their edges.
    """
    edges = [corners[:, (k + 1) % 3] - corners[:, k] for k in range(3)]
    normal = np.cross(edges[0], -edges[2])
    size2 = sum((edge**2).sum(axis=1) for edge in edges)
    t, number, clear = np.full(len(o), np.inf), np.full(len(o), -1), np.ones(len(o), bool)
    second = np.full(len(o), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for k in range(len(corners)):
            speed = d @ normal[k]
            sides = []
            for j in range(3):
                a, b = corners[k, j] - o, corners[k, (j + 1) % 3] - o
                sides.append((np.cross(a, b) * d).sum(axis=1))
            distance = ((corners[k, 0] - o) @ normal[k]) / speed
            low, high = np.min(sides, axis=0), np.max(sides, axis=0)
            reach = np.sqrt(((corners[k] - o[:, None]) ** 2).sum(axis=2)).max(axis=1) * np.sqrt(size2[k])
            touched = (low >= -CLEARANCE * reach) | (high <= CLEARANCE * reach)
            inside = (low > CLEARANCE * reach) | (high < -CLEARANCE * reach)
            flat_on = np.abs(speed) < 1e-2 * np.linalg.norm(normal[k])
            clear &= ~touched | (inside & ~flat_on)
            valid = inside & (distance > 0)
            second = np.where(valid, np.minimum(second, np.maximum(t, distance)), second)
            nearer = valid & (distance < t)
            t, number = np.where(nearer, distance, t), np.where(nearer, k, number)
        clear &= ~(np.isfinite(t) & np.isfinite(second)) | (second - t > 1e-4 * (t + np.abs(o).max()))
    return t, number, clear


CLEARANCE = 1e-5
"""How far from an edge, in shares of size and distance, a ray must pass for rounding to have no say."""


def rays(seed: int, n: int, corners: Array) -> tuple[Array, Array]:
    """Random ones, and half of them along an axis or in a plane of two: components that are 0 and -0."""
    rng = np.random.default_rng(seed)
    middle, size = corners.mean(axis=(0, 1)), np.ptp(corners, axis=(0, 1)).max()
    target = corners[rng.integers(len(corners), size=n)].mean(axis=1)
    d = directions(rng, n)
    grazing = rng.random(n) < 0.2
    d[grazing, 1] *= 1e-3
    zero = (rng.random((n, 3)) < 0.5) & (rng.random((n, 1)) < 0.5)
    zero[zero.all(axis=1)] = False
    d = np.where(zero, np.where(rng.random((n, 3)) < 0.5, 0.0, -0.0), unit(d))
    o = target - unit(d) * size * rng.uniform(0, 2, (n, 1))
    random = rng.random(n) < 0.2
    o[random] = middle + size * rng.uniform(-1, 1, (int(random.sum()), 3))
    return single(o), d


def compare_with_all(corners: Array, seed: int, n: int, precision: str) -> None:
    o, d = rays(seed, n, corners)
    hits = tracer.intersect(scene_of(corners), o, d, precision=precision)
    t, number, clear = nearest(corners, o, unit(d))
    assert clear.mean() > 0.5
    assert (number[clear] >= 0).mean() > 0.2
    wrong = clear & (hits.primitive != number)
    assert not wrong.any(), f"{int(wrong.sum())} of {n}: from {o[wrong][0]} along {d[wrong][0]}"
    hit = clear & (number >= 0)
    bound = {"single": 1e-4, "double": 1e-11}[precision] * (np.abs(o).max() + np.abs(corners).max())
    assert np.abs(hits.t[hit] - t[hit]).max() <= bound


RAY_MESHES: dict[str, Callable[[], Array]] = {
    "soup": lambda: soup(6, 60, 1.0),
    "flat": lambda: np.concatenate([flat(axis)[:20] * 2 for axis in range(3)]),
    "huge": lambda: single(soup(7, 40, 1.0) * 1e15),
    "tiny": lambda: single(soup(7, 40, 1.0) * 1e-15),
    "two": lambda: soup(9, 2, 1.0),
}


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("name", RAY_MESHES)
def test_nearest_hits_are_those_of_all_triangles(name: str, precision: str, form: str) -> None:
    compare_with_all(RAY_MESHES[name](), 3, 4000, precision)


@pytest.mark.parametrize("scale", [1e17, 1e-30])
def test_nearest_hits_at_the_ends_of_single_precision(scale: float, form: str) -> None:
    compare_with_all(single(soup(7, 40, 1.0) * scale), 3, 4000, "double")


# ---- Boxes never decide ------------------------------------------------------------------------------------


def slivers(seed: int, count: int) -> Array:
    """Needles across the cube, far thinner than long."""
    corners = soup(seed, count, 1.0)
    corners[:, 2] = corners[:, 0] + 1e-5 * (corners[:, 2] - corners[:, 0])
    return single(corners)


def pile(seed: int) -> Array:
    """Walls in planes across the axes, many of them in one plane, and boxes without thickness."""
    rng = np.random.default_rng(seed)
    walls = []
    for axis in range(3):
        wall = soup(seed + axis, 80, 1.0)
        wall[..., axis] = rng.integers(-2, 3, (80, 1)) / 4
        walls.append(wall)
    return np.concatenate(walls)


SOUPS: dict[str, Callable[[int], Array]] = {
    "soup": lambda seed: soup(seed, 300, 1.0),
    "fine soup": lambda seed: soup(seed, 600, 0.1),
    "slivers": lambda seed: slivers(seed, 200),
    "walls": pile,
    "huge": lambda seed: single(soup(seed, 200, 1.0) * 1e15),
    "tiny": lambda seed: single(soup(seed, 200, 1.0) * 1e-15),
    "far": lambda seed: single(soup(seed, 200, 1.0) + 300),
    "scales": lambda seed: np.concatenate([single(soup(seed + k, 60, 1.0) * 10.0**-k) for k in range(5)]),
    "icosphere": lambda seed: single((lambda mesh: mesh[0][mesh[1]])(icosphere(2))),
}


def hard_rays(seed: int, n: int, corners: Array) -> tuple[Array, Array]:
    """Towards corners and points of edges, within the planes of triangles, along axes, from corners."""
    rng = np.random.default_rng(seed)
    size = np.ptp(corners, axis=(0, 1)).max()
    chosen = corners[rng.integers(len(corners), size=n)]
    share = rng.uniform(0, 1, (n, 1)) * (rng.random((n, 1)) < 0.7)
    target = chosen[:, 0] + share * (chosen[:, 1] - chosen[:, 0])
    d = unit(directions(rng, n))
    kind = rng.integers(4, size=n)
    within = chosen[:, 2] - chosen[:, 0] + rng.uniform(-1, 1, (n, 1)) * (chosen[:, 1] - chosen[:, 0])
    length = np.linalg.norm(within, axis=1)
    grazing = (kind == 1) & (length > 0)
    d[grazing] = within[grazing] / length[grazing, None]
    along = rng.integers(3, size=n)
    straight = np.where(
        np.arange(3) == along[:, None], rng.choice([-1.0, 1.0], (n, 1)), rng.choice([0.0, -0.0], (n, 3))
    )
    d[kind == 2] = straight[kind == 2]
    away = size * rng.uniform(0.1, 2, (n, 1)) * (kind < 3)[:, None]
    return single(target - d * away), d


def compare_with_open_boxes(corners: Array, seed: int, n: int, precision: str) -> None:
    """Every ray: the hit is bit for bit that of the same tests on all triangles, no box missed."""

    def open_box(slabs: Any, node: Any, limit: Any) -> Any:
        return limit == limit

    scene = scene_of(corners)
    for rays_of in (rays, hard_rays):
        o, d = rays_of(seed, n, corners)
        found = tracer.intersect(scene, o, d, precision=precision)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(traverse.Slabs, "crossed", open_box)
            patch.setattr(device_meshes, "threaded", threaded)
            everything = tracer.intersect(scene, o, d, precision=precision)
        assert 0.1 < everything.valid.mean()
        different = (found.primitive != everything.primitive) | ((found.t != everything.t) & found.valid)
        assert not different.any(), (
            f"{int(different.sum())} of {n}: from {o[different][0]} along {d[different][0]}"
        )


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("name", SOUPS)
def test_boxes_never_change_a_hit(name: str, precision: str, form: str) -> None:
    compare_with_open_boxes(SOUPS[name](21), 4, 3000, precision)


def test_grazing_hits_anywhere_along_the_ray_are_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(traverse, "GRAZING", 0.0)
    with pytest.raises(AssertionError):
        compare_with_open_boxes(SOUPS["soup"](21), 4, 3000, "single")


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("name", SOUPS)
def test_boxes_never_change_a_hit_of_many_soups(name: str, precision: str, form: str) -> None:
    for seed in range(30, 34):
        compare_with_open_boxes(SOUPS[name](seed), seed, 20_000, precision)


@pytest.mark.parametrize("damage", [jump_too_far, boxes_too_small, planes_swapped, leaf_one_short])
def test_planted_error_is_caught(
    damage: Callable[[Lists], None], monkeypatch: pytest.MonkeyPatch, form: str
) -> None:
    monkeypatch.setattr(device_meshes, "threaded", damaged(damage))
    with pytest.raises(AssertionError):
        compare_with_all(RAY_MESHES["soup"](), 3, 4000, "double")
    with pytest.raises(AssertionError):
        compare_with_open_boxes(RAY_MESHES["soup"](), 3, 4000, "double")


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["single", "double"])
def test_nearest_hits_of_many_soups(precision: str) -> None:
    for seed in range(12):
        compare_with_all(soup(seed, 120, 1.0), seed, 6000, precision)


@pytest.mark.parametrize("precision", ["single", "double"])
def test_the_order_in_the_file_makes_no_difference(precision: str) -> None:
    """Of equal distances the lower primitive counts; what is hit, and where, is the same in any order."""
    rng = np.random.default_rng(2)
    vertices, faces = icosphere(2)
    corners = single((vertices @ rotation(rng).T)[faces])
    corners = np.concatenate([corners, corners[::3], single(corners * [1, 0.5, 1])])
    o, d = rays(5, 20_000, corners)
    first = tracer.intersect(scene_of(corners), o, d, precision=precision)
    assert first.valid.mean() > 0.5
    for _ in range(3):
        shuffled = rng.permutation(len(corners))
        again = tracer.intersect(scene_of(corners[shuffled]), o, d, precision=precision)
        assert np.array_equal(first.t, again.t)
        assert np.array_equal(first.valid, again.valid)
        # Where the primitive is another one, both were met at the same distance: twins, or a shared edge.
        hit = first.valid
        mine, theirs = corners[first.primitive[hit]], corners[shuffled][again.primitive[hit]]
        same = (mine == theirs).all(axis=(1, 2))
        assert same.mean() > 0.99
        lowest = {corner.tobytes(): k for k, corner in reversed(list(enumerate(corners)))}
        twins = [lowest[corner.tobytes()] for corner in mine]
        assert np.array_equal(np.array(twins), first.primitive[hit])


def test_a_ray_along_a_flat_box_and_exactly_between_two() -> None:
    """Boxes without thickness are entered by rays that run in their plane next to another triangle."""
    wall = np.array([[[0, 0, 0], [0, 2, 0], [0, 0, 2]], [[0, 2, 2], [0, 0, 2], [0, 2, 0]]], float)
    target = np.array([[[-1, 3, -1], [1, 3, -1], [0, 3, 3]]], float)
    for precision in ("single", "double"):
        hits = tracer.intersect(
            scene_of(np.concatenate([wall, target])),
            [[0, -1, 0.5], [0.0, -1, 0.5], [-1, 0.5, 0.5]],
            [[0.0, 1, 0], [-0.0, 1, -0.0], [1, 0.0, -0.0]],
            precision=precision,
        )
        assert hits.primitive.tolist() == [2, 2, 0]
        assert hits.t.tolist() == [4.0, 4.0, 1.0]
