"""Rays aimed at edges and corners of closed rough meshes, by tracer beside Embree: none may pass."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np
import pytest

import tracer
from reference.bench.scenes import Workshop, mesh_alone
from reference.comparison import Case, Outcome
from reference.comparison.aims import SHARES, aimed
from reference.comparison.seams import compare_seams
from reference.exact import edge_functions, passes_through
from reference.random_scenes import random_scene
from tracer.acceleration import traverse

pytest.importorskip("mitsuba")

SLOW = pytest.mark.slow
RAYS = 20_000


def case_of(folder: Path, size: str, precision: str = "single", rays: int = RAYS) -> Case:
    return Case(mesh_alone(Workshop(folder), size), precision=precision, rays=rays)


def seams(case: Case) -> Outcome:
    """That of a mesh whose fans all rays meet, most of them first."""
    found = compare_seams(case)
    assert found.rays + found.excluded > 0.8 * case.rays and found.excluded <= 1
    return found


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize(("size", "rays"), [("3k", RAYS), pytest.param("82k", 314_000, marks=SLOW)])
def test_no_ray_passes_and_embree_lets_some(size: str, rays: int, precision: str, tmp_path: Path) -> None:
    found = seams(case_of(tmp_path, size, precision, rays))
    assert found.passed, str(found)
    assert found.ours_error == 0 and found.figures["lost, Mitsuba"] == found.figures["beside, Mitsuba"] == 0
    assert found.figures["behind, Mitsuba"] > 0  # else its row of the table of tolerances has no reason


def test_what_embree_lets_through_meets_the_surface(tmp_path: Path) -> None:
    """So say all triangles in extended precision, which know nothing of fans."""
    case = case_of(tmp_path, "3k")
    rays, t = aimed(case).rays, aimed(case).t
    theirs = case.bench.mitsuba.intersect(rays.o, rays.d)
    passed = np.flatnonzero(theirs.t > 1.001 * t)[:10]
    some = np.append(np.arange(0, len(rays), len(rays) // 20), passed)
    _, _, nearest = case.bench.truth.nearest(rays.o[some], rays.d[some])
    assert len(passed) == 10 and (nearest < t[some] * (1 + 1e-12)).all()
    np.testing.assert_allclose(nearest[-10:], t[passed], rtol=1e-9)


def test_rays_aim_at_all_that_they_should(tmp_path: Path) -> None:
    """As many as asked for, within rounding of an edge; along axes the corner is met exactly."""
    aim = aimed(case_of(tmp_path, "3k", rays=4000))
    assert len(aim.rays) == 4000 and np.isfinite(aim.t).all() and (aim.cosine > 1e-3).all()
    along = (aim.rays.d != 0).sum(axis=1) == 1
    assert along.mean() == SHARES["corners, along axes"]
    truth, k, of = case_of(tmp_path, "3k").bench.truth, aim.fans.members, aim.fans.of
    values = edge_functions(aim.rays.o[of], aim.rays.d[of], truth.corners[k])
    exact = (values == 0).sum(axis=1)
    assert (exact[along[of]] == 2).all() and exact[~along[of]].sum() == 0
    assert (np.abs(values).min(axis=1) < 1e-6).all()


def test_edge_functions_against_fractions() -> None:
    """The sign is right where doubles alone get it wrong."""
    rng = np.random.default_rng(0)

    def single(*shape: int) -> Any:
        return rng.normal(size=shape).astype(np.float32).astype(np.float64)

    corners, d = single(400, 3, 3), single(400, 3)
    d[::4] = np.eye(3)[rng.integers(3, size=100)]
    o = (corners[:, 0] - 3 * d).astype(np.float32).astype(np.float64)
    values = edge_functions(o, d, corners)
    for k in range(len(o)):
        way = [Fraction(x) for x in d[k].tolist()]
        seen = [[Fraction(x) - Fraction(y) for x, y in zip(c, o[k].tolist(), strict=True)] for c in
                corners[k].tolist()]  # fmt: skip
        for i in range(3):
            b, c = seen[(i + 1) % 3], seen[(i + 2) % 3]
            exact = sum(way[j] * (b[j - 2] * c[j - 1] - b[j - 1] * c[j - 2]) for j in range(3))
            assert np.sign(values[k, i]) == np.sign(float(exact))
            assert values[k, i] == pytest.approx(float(exact), rel=1e-12, abs=1e-13)
    assert passes_through(values)[::4].all() and (values[::4, 1:] == 0).mean() > 0.2


def moller_trumbore(_: float, triangle: Any, ray: Any, found: Any) -> Any:
    """Barycentric coordinates, each rounded by itself (Moller and Trumbore, 1997)."""
    first, second, start = triangle.v1 - triangle.v0, triangle.v2 - triangle.v0, ray.o - triangle.v0
    across = dr.cross(ray.d, second)
    scale = dr.rcp(dr.dot(first, across))
    u = dr.dot(start, across) * scale
    v = dr.dot(ray.d, dr.cross(start, first)) * scale
    return (u >= 0) & (v >= 0) & (u + v <= 1)


def too_large(epsilon: float, triangle: Any, ray: Any, found: Any) -> Any:
    """Triangles reach over their edges by a hundred times more than rounding: no ray is lost so."""
    a, b, c = found.edges
    far = 2000 * epsilon * found.size**2
    return ((a >= -far) & (b >= -far) & (c >= -far)) | ((a <= far) & (b <= far) & (c <= far))


def without_border(_: float, triangle: Any, ray: Any, found: Any) -> Any:
    """A ray exactly through an edge counts for neither side."""
    a, b, c = found.edges
    return ((a > 0) & (b > 0) & (c > 0)) | ((a < 0) & (b < 0) & (c < 0))


@pytest.mark.parametrize(
    ("plant", "fault", "precision"),
    [
        (moller_trumbore, "behind", "single"),
        (too_large, "beside", "single"),
        (without_border, "behind", "single"),
        (without_border, "behind", "double"),
    ],
)
def test_a_planted_error_is_caught(
    plant: Any, fault: str, precision: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    true = traverse.meet_triangle

    def meet(epsilon: float, triangle: Any, ray: Any, axes: Any) -> Any:
        found = true(epsilon, triangle, ray, axes)
        return replace(found, within=plant(epsilon, triangle, ray, found))

    monkeypatch.setattr(traverse, "meet_triangle", meet)
    found = seams(case_of(tmp_path, "3k", precision, 4000))
    assert not found.passed and found.guilty == "ours", str(found)
    assert found.figures[f"{fault}, ours"] > 10
    assert found.worst is not None and "meets the surface" in str(found)


def test_a_ray_at_a_corner_is_traced_as_it_is_given() -> None:
    """Its direction has unit length within rounding; normalized once more, it passes a tetrahedron by."""
    ray = (
        [0.618035078048706, -0.014169340953230858, 0.20642338693141937],
        [-0.9501326084136963, 0.13199056684970856, -0.2825358808040619],
    )
    hits = tracer.intersect(random_scene(8), *(np.array([v]) for v in ray), precision="single")
    assert hits.shape.tolist() == [3] and abs(hits.t[0] - 0.2374826) < 1e-6
