"""Polygons cut into triangles: exactly, without gaps or overlaps, and as the plain version cuts them."""

from __future__ import annotations

import numpy as np
import pytest

from reference.plain_polygons import cut
from tracer.shapes import cutting
from tracer.shapes.cutting import cut_polygons

Flat = tuple[int, int]


def turn(a: Flat, b: Flat, c: Flat) -> int:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def touches(a: Flat, b: Flat, p: Flat) -> bool:
    """Whether p lies on the edge from a to b."""
    inside = all(min(s, t) <= x <= max(s, t) for s, t, x in zip(a, b, p, strict=True))
    return turn(a, b, p) == 0 and inside


def meet(a: Flat, b: Flat, c: Flat, d: Flat) -> bool:
    """Whether two edges have a point in common."""
    if turn(a, b, c) * turn(a, b, d) < 0 and turn(c, d, a) * turn(c, d, b) < 0:
        return True
    return touches(a, b, c) or touches(a, b, d) or touches(c, d, a) or touches(c, d, b)


def is_simple(p: list[Flat]) -> bool:
    n = len(p)
    for i in range(n):
        for j in range(i + 1, n):
            a, b, c, d = p[i], p[(i + 1) % n], p[j], p[(j + 1) % n]
            if j == i + 1:
                wrong = touches(a, b, d) or touches(c, d, a)
            elif (j + 1) % n == i:
                wrong = touches(a, b, c) or touches(c, d, b)
            else:
                wrong = meet(a, b, c, d)
            if wrong:
                return False
    return len(set(p)) == n


def simple_polygon(rng: np.random.Generator) -> list[Flat]:
    """4 to 15 corners on a coarse grid, many of them on straight edges; crossings are turned round."""
    while True:
        n, size = int(rng.integers(4, 16)), int(rng.choice([3, 4, 6, 20]))
        p = [(int(x), int(y)) for x, y in rng.integers(-size, size + 1, (n, 2))]
        for _ in range(100):
            pairs = ((i, j) for i in range(n) for j in range(i + 2, n) if (i, j) != (0, n - 1))
            crossing = next(
                (k for k in pairs if meet(p[k[0]], p[k[0] + 1], p[k[1]], p[(k[1] + 1) % n])), None
            )
            if crossing is None:
                break
            i, j = crossing
            p = p[: i + 1] + p[i + 1 : j + 1][::-1] + p[j + 1 :]
        if is_simple(p):
            return p


def cut_one(points: np.ndarray) -> list[list[int]]:
    """The triangles of one polygon (n, 3)."""
    found: list[list[int]] = cut_polygons(points, np.arange(len(points)), np.array([len(points)])).tolist()
    return found


@pytest.mark.parametrize("seed", range(4))
def test_simple_polygons_are_covered_once(seed: int) -> None:
    """All triangles turn as the polygon does, their areas add up to its own, and no corner lies in or on
    another's triangle: no gap opens to whatever lies beyond a straight edge."""
    rng = np.random.default_rng(seed)
    for _ in range(75):
        p = simple_polygon(rng)
        whole = sum(turn(p[0], p[k], p[k + 1]) for k in range(1, len(p) - 1))
        axes = rng.permutation(3)
        points = np.array([[x, y, 2 * x - y] for x, y in p], float)[:, axes]
        triangles = cut_one(points)
        sign = 1 if whole > 0 else -1
        areas = [turn(*(p[k] for k in t)) for t in triangles]
        assert len(areas) == len(p) - 2 and min(sign * area for area in areas) > 0 and sum(areas) == whole
        for i, j, k in triangles:
            edges = [(p[i], p[j]), (p[j], p[k]), (p[k], p[i])]
            others = [q for n, q in enumerate(p) if n not in (i, j, k)]
            assert not any(all(sign * turn(*edge, q) >= 0 for edge in edges) for q in others)
        assert triangles == [list(t) for t in cut(points.tolist())]


def test_a_hole_on_a_bridge() -> None:
    """A square with a hole, its outline closed by an edge that runs to the hole and back."""
    outer, hole = [(0, 0), (9, 0), (9, 9), (0, 9)], [(3, 3), (3, 6), (6, 6), (6, 3)]
    outline = [*outer, outer[0], *hole, hole[0]]
    for start in range(len(outline)):
        p = outline[start:] + outline[:start]
        areas = [turn(*(p[k] for k in t)) for t in cut_one(np.array([[x, y, 0] for x, y in p], float))]
        assert min(areas) >= 0 and sum(areas) == 2 * (81 - 9)


def test_convex_polygons_are_fans() -> None:
    """Also at 45 degrees, where two axes are equally good, out of plane, and at any scale."""
    angles = np.linspace(0, 2 * np.pi, 9, endpoint=False)
    for scale in (1e-38, 1.0, 1e37):
        for lift in (0.0, 1.0, 1e-7):
            points = np.stack([np.cos(angles), np.sin(angles), lift * np.cos(angles)], axis=1)
            single = (scale * points).astype(np.float32).astype(float)
            assert cut_one(single) == [[0, k, k + 1] for k in range(1, 8)]


@pytest.mark.parametrize("seed", range(3))
def test_whatever_it_is_both_versions_cut_it_alike(seed: int) -> None:
    """Bent, crossing, flat and degenerate polygons, of numbers from tiny to huge."""
    rng = np.random.default_rng(seed)
    for n in (*range(4, 12), 30):
        for scale in (1e-44, 1.0, 1e30):
            for points in (
                rng.normal(size=(n, 3)),
                rng.integers(0, 3, (n, 3)),
                rng.integers(0, 2, (n, 1)) * [1, 1, 1],
            ):
                single = (scale * points).astype(np.float32).astype(float)
                assert cut_one(single) == [list(t) for t in cut(single.tolist())]


def quads(kind: str, rng: np.random.Generator, count: int) -> np.ndarray:
    """(count, 4, 3) corners of any quads."""
    points = rng.normal(size=(count, 4, 3))
    if kind == "coarse":
        points = np.round(2 * points)
    elif kind == "in a plane":
        u, v = rng.normal(size=(2, count, 1, 3))
        points = points[..., :1] * u + points[..., 1:2] * v
    elif kind == "far away":
        points = points * [1, 1, 1e-6] + 1e5
    return points.astype(np.float32).astype(np.float64)


@pytest.mark.parametrize("kind", ["warped", "coarse", "in a plane", "far away"])
def test_many_quads_at_once_are_cut_like_each_by_itself(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    points = quads(kind, np.random.default_rng(9), 600)
    sure = cutting._sure_to_need_the_other_diagonal(points)
    assert kind == "far away" or sure.sum() > 20
    found = cut_polygons(points.reshape(-1, 3), np.arange(2400), np.full(600, 4))
    monkeypatch.setattr(cutting, "_sure_to_need_the_other_diagonal", lambda quads: np.zeros(len(quads), bool))
    exact = cut_polygons(points.reshape(-1, 3), np.arange(2400), np.full(600, 4))
    assert np.array_equal(found, exact)
