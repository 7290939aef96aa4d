"""Ours against Mitsuba and against extended precision, ray by ray: scene x term x precision."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction
from functools import cache

import numpy as np
import pytest

import tracer
from reference import extended
from reference.comparison import Case, Outcome, all_terms, backends, find_terms, run
from reference.comparison.grazing import silhouette_distance, tie_distance
from reference.comparison.rays import pixel_rays
from reference.comparison.selection import random_subject
from reference.comparison.truth import Truth
from reference.random_scenes import random_scene
from tests.accuracy.probe import directions
from tracer.assets import builtin_scenes
from tracer.backends import has_cuda
from tracer.errors import UsageError

pytest.importorskip("mitsuba")

RANDOM_SCENES = 4
QUICK_SCENES = ("room", "random-3")
OTHER_SCENES = sorted({*builtin_scenes(), *(f"random-{k}" for k in range(RANDOM_SCENES))} - {*QUICK_SCENES})
RAYS = 10_000
TERMS = [term.name for term in all_terms()]
PRECISIONS = ("single", "double")
BACKENDS = ("llvm", pytest.param("cuda", marks=pytest.mark.skipif(not has_cuda(), reason="no GPU")))


def scene_of(name: str) -> tracer.Scene:
    """A built-in scene, or a random one by its number."""
    return random_scene(int(name[7:])) if name.startswith("random-") else tracer.load(name)


@cache
def case_of(name: str, precision: str, backend: str) -> Case:
    """The case of a scene; both precisions share its rays and Mitsuba's answers."""
    if precision != PRECISIONS[0]:
        return case_of(name, PRECISIONS[0], backend).in_precision(precision)
    return Case(scene_of(name), precision=precision, backend=backend, rays=RAYS)


def check(name: str, term: str, precision: str, backend: str) -> None:
    (wanted,) = find_terms([term])
    case = case_of(name, precision, backend)
    if not wanted.suits(case.scene, precision):
        pytest.skip("there is nothing to compare")
    outcome = wanted.run(case)
    assert outcome.passed, str(outcome)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("term", TERMS)
@pytest.mark.parametrize("name", QUICK_SCENES)
def test_agrees_with_mitsuba_and_extended_precision(
    name: str, term: str, precision: str, backend: str
) -> None:
    check(name, term, precision, backend)


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", OTHER_SCENES)
def test_agrees_on_every_other_scene(name: str, backend: str) -> None:
    outcomes = run([scene_of(name)], all_terms(), PRECISIONS, RAYS, backend=backend)
    assert not [str(outcome) for outcome in outcomes if not outcome.passed]


@pytest.mark.parametrize("precision", PRECISIONS)
def test_two_backends_are_compared_like_two_tracers(precision: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """What compares CUDA with LLVM, tried where there is no GPU: a backend agrees with itself; an error that
    is planted in one of the two is found, and is that one's."""
    case = Case(scene_of("room"), precision=precision, rays=2_000)
    for compare in (backends.compare_hits, backends.compare_distances):
        same = compare(case, "llvm", "llvm")
        assert same.passed and same.measured == 0 and same.backend == "llvm and llvm"
    true = backends.hits_on

    def off(case: Case, backend: str) -> tracer.Hits:
        hits = true(case, "llvm")
        if backend == "llvm":
            return hits
        return replace(hits, t=hits.t * (1 + 1e-4), primitive=hits.primitive + (hits.shape == 2))

    monkeypatch.setattr(backends, "hits_on", off)
    hits, distances = backends.compare_hits(case), backends.compare_distances(case)
    assert (hits.passed, hits.guilty, hits.measured > 0) == (False, "cuda", True)
    assert (distances.passed, distances.guilty) == (False, "cuda")


def test_an_outcome_is_json_and_names_a_ray() -> None:
    seen = []
    outcomes = run(
        [random_subject(3)],
        find_terms(["hits", "distance, sphere", "chain growth"]),
        ("double",),
        2_000,
        progress=lambda done, total, outcome: seen.append((done, total, outcome.term)),
    )
    assert seen == [(1, 3, "hits"), (2, 3, "distance, sphere"), (3, 3, "chain growth")]
    table = json.loads(json.dumps([outcome.to_dict() for outcome in outcomes], allow_nan=False))
    hits, distance, growth = table
    assert hits["ours_error"] is None and hits["verdict"] == "passed"
    assert len(distance["samples"]) == len(distance["distance_to_silhouette"]) > 100
    assert distance["ours_error"] < 16 and distance["margin"] > 1
    assert distance["worst"]["command"].startswith("tracer validate --random 1 --seed 3 --")
    assert [step["vertex"] for step in growth["growth"]] == list(range(1, len(growth["growth"]) + 1))


def test_a_failure_says_which_ray_both_answers_and_how_to_replay_it() -> None:
    outcome = Outcome("hits", "room", "double", "llvm", 10, measured=3.0, allowed=0.0, unit="rays")
    assert not outcome.passed and "hits, room, double: failed; measured 3, allowed 0 rays" in str(outcome)
    (real,) = run([tracer.load("room")], find_terms(["distance, plane"]), ("double",), 500)
    assert real.worst is not None
    for part in ("ray [", "ours t =", "Mitsuba t =", "extended precision t =", "replay: "):
        assert part in str(real), str(real)
    assert not Outcome("x", "s", "double", "llvm", 1, 0, 1, "", ours_error=2, ours_allowed=1).passed
    assert not Outcome("x", "s", "double", "llvm", 1, 0, 1, "", mitsuba_error=2, mitsuba_allowed=1).passed
    assert not Outcome("x", "s", "double", "llvm", 1, 0, 1, "", excluded=2, excluded_allowed=1).passed


def test_an_unknown_term_is_named() -> None:
    with pytest.raises(UsageError, match="term: 'hit' is unknown; allowed are placement; camera rays; "):
        find_terms(["hit"])


@pytest.mark.parametrize("seed", range(4))
def test_random_scenes_repeat_and_differ(seed: int) -> None:
    scene = random_scene(seed)
    assert scene == random_scene(seed) != random_scene(seed + 1)
    assert scene.name == f"random-{seed}"
    rays = pixel_rays(scene, 500, np.random.default_rng(0))
    assert tracer.intersect(scene, rays.o, rays.d).valid.mean() > 0.3


def test_extended_precision_against_fractions() -> None:
    """Hits of a plane and a triangle in rational numbers, up to the rounding of long doubles."""
    rng = np.random.default_rng(1)
    o, d = rng.uniform(-3, 3, (20, 3)), directions(rng, 20)
    plane, corners = rng.uniform(-1, 1, (20, 4)), rng.uniform(-1, 1, (20, 3, 3))
    t_plane, _ = extended.plane_hit(o, d, plane)
    t_triangle, _ = extended.triangle_hit(o, d, corners)
    for k in range(20):
        origin, way = ([Fraction(x) for x in v[k].tolist()] for v in (o, d))
        n, offset = [Fraction(x) for x in plane[k, :3].tolist()], Fraction(float(plane[k, 3]))
        _is_near(t_plane[k], n, offset, origin, way)
        a, b, c = ([Fraction(x) for x in v.tolist()] for v in corners[k])
        u, v = [x - y for x, y in zip(b, a, strict=True)], [x - y for x, y in zip(c, a, strict=True)]
        n = [u[i - 2] * v[i - 1] - u[i - 1] * v[i - 2] for i in range(3)]
        _is_near(t_triangle[k], n, -sum(x * y for x, y in zip(n, a, strict=True)), origin, way)


def _is_near(
    t: object, n: list[Fraction], offset: Fraction | int, o: list[Fraction], d: list[Fraction]
) -> None:
    """t = -(n.o + offset) / n.d within 1e-15, far below an ulp of double precision."""
    exact = -(sum(x * y for x, y in zip(n, o, strict=True)) + offset) / sum(
        x * y for x, y in zip(n, d, strict=True)
    )
    high = float(exact)
    rest = float(exact - Fraction(high))
    assert abs(float(np.longdouble(str(t)) - np.longdouble(high)) - rest) < 1e-17 * max(1, abs(high) * 1e2)


def test_extended_optics() -> None:
    """Mirror and refraction keep lengths, Snell's law holds, and both ways give the first direction back."""
    rng = np.random.default_rng(2)
    n = extended.unit(rng.normal(size=(100, 3)))
    d = extended.unit(directions(rng, 100))
    d = np.where((extended.dot(d, n) < 0)[:, None], d, -d)
    twice = extended.mirror(extended.mirror(d, n), n)
    assert np.abs(extended.double(twice - d)).max() < 1e-18
    bent, k = extended.refract(d, n, np.full(100, 1 / 1.5))
    assert (k > 0).all() and np.abs(extended.double(extended.dot(bent, bent) - 1)).max() < 1e-18
    sines = [extended.cross(v, n) for v in (d, bent)]
    assert np.abs(extended.double(sines[0] * extended.number(1 / 1.5) - sines[1])).max() < 1e-18
    _, k = extended.refract(-bent, -n, np.full(100, 1.5))
    assert (k > 0).all()
    grazing = extended.unit(d + 3 * extended.unit(d - extended.dot(d, n)[:, None] * n))
    assert (extended.refract(grazing, n, np.full(100, 2.4))[1] < 0).any()


def test_grazing_distances_of_known_rays() -> None:
    truth = Truth.of(
        tracer.load(
            {
                "shapes": [
                    {"kind": "sphere", "center": [0, 0, 0], "radius": 1},
                    {"kind": "mesh", "vertices": [[2, 0, 0], [4, 0, 0], [2, 2, 0]], "faces": [[0, 1, 2]]},
                    {"kind": "plane", "coefficients": [0, 0, 1, 0.25]},
                ]
            }
        )
    )
    o = np.array([[0.9, 0, 5], [1.2, 0, 5], [3, 0.1, 5], [0, 0, 0]])
    d = np.tile([0.0, 0, -1], (4, 1))
    everywhere = np.full(4, np.inf)
    assert np.allclose(silhouette_distance(truth, o, d, everywhere), [0.1, 0.2, 0.1, np.inf])
    assert np.isinf(silhouette_distance(truth, o, d, np.full(4, 0.5))).all()
    tie = tie_distance(truth, o[2:3], d[2:3], np.array([[1, 0]]), np.array([[2, 0]]))
    assert tie == pytest.approx(0.125)


def test_long_double_is_wide_here_or_mpmath_stands_in(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mpmath")
    o, d = np.array([[3.0, 1, 2]]), np.array([[-1.0, 0.1, 0]])
    row = np.array([[0.1, 0.2, 0.3, 1.5]])
    expected = [extended.double(x) for x in extended.sphere_roots(o, extended.unit(d), row)]
    camera = tracer.load("room").camera
    rays = [extended.double(x) for x in extended.camera_rays(camera, [3.5], [4.5])]
    monkeypatch.setattr(extended, "HAS_LONG_DOUBLE", False)
    found = [extended.double(x) for x in extended.sphere_roots(o, extended.unit(d), row)]
    assert np.allclose(found, expected, rtol=1e-15, atol=0)
    assert np.allclose(
        [extended.double(x) for x in extended.camera_rays(camera, [3.5], [4.5])], rays, rtol=1e-14, atol=1e-16
    )
