"""What spares shadow rays is right about hierarchies: each verdict on a light against the shadow rays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tests.accuracy.beams import (
    ask_triangles,
    check_lone,
    check_many_spheres,
    check_triangles,
    inside_of,
    lights_around,
    moved,
    slivers_over_plane,
    smooth_solids,
    solid,
    solids,
    soup,
    stand_on,
    wall_on_floor,
)
from tests.accuracy.probe import compiled
from tests.accuracy.shafts import PRECISIONS, check_inside, report
from tracer.acceleration import beam
from tracer.backends import exact_arithmetic
from tracer.device_meshes import is_convex

STAGES = [soup, solids, smooth_solids, wall_on_floor, slivers_over_plane]


@pytest.mark.parametrize("precision", PRECISIONS)
def test_a_light_behind_triangles(precision: str) -> None:
    found = check_triangles(soup, precision, 10_000, 1)
    assert found.some.mean() > 0.1
    assert (found.verdict == beam.CLEAR)[found.lit & ~found.some].mean() > 0.3
    assert (found.verdict == beam.COVERED)[found.lit & found.every].mean() > 0.2


@pytest.mark.parametrize("precision", PRECISIONS)
def test_a_light_behind_many_spheres(precision: str) -> None:
    found = check_many_spheres(precision, 10_000, 1)
    assert 0.1 < found.some.mean() < 0.9
    assert (found.verdict == beam.CLEAR)[found.lit & ~found.some].mean() > 0.3
    assert (found.verdict == beam.COVERED)[found.lit & found.every].mean() > 0.2


@pytest.mark.slow
@pytest.mark.parametrize("precision", PRECISIONS)
def test_many_lights_behind_many_spheres(precision: str) -> None:
    for seed in range(2, 8):
        check_many_spheres(precision, 50_000, seed, count=40 * seed)


@pytest.mark.slow
@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("make", STAGES)
def test_many_lights_behind_triangles(make: Callable[..., Any], precision: str) -> None:
    for seed in range(3):
        check_triangles(make, precision, 20_000, seed)


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("name", ["cube", "tetrahedron", "icosphere"])
def test_a_convex_mesh_hides_no_light_from_its_outside(name: str, precision: str) -> None:
    rng = np.random.default_rng(8)
    scene = compiled({"shapes": [moved(solid(name, rng), rng.uniform(-2, 2, 3))]}, precision)
    mesh = scene.host.meshes[0]
    if precision == "single":
        assert is_convex(mesh, scene.backend.epsilon) and scene.enclosures[0].convex
    chosen = mesh.corners[rng.integers(len(mesh.corners), size=10_000)]
    with exact_arithmetic():
        stand = stand_on(scene, inside_of(chosen, rng), rng)
        found = ask_triangles(scene, stand, lights_around(stand, chosen, rng, 3))
    outside = stand.surface.entering.numpy()
    if scene.enclosures[0].convex:
        report("hidden by a convex mesh", found.some & outside, found.lanes)
    assert (found.lit & outside).mean() > 0.1


@pytest.mark.parametrize("change", ["dent", "second", "hollow"])
def test_other_meshes_do_not_pass_for_convex(change: str) -> None:
    rng = np.random.default_rng(4)
    shape = solid("icosphere", rng)
    vertices, faces = np.array(shape["vertices"]), np.array(shape["faces"])
    if change == "dent":
        vertices[3] *= 0.8
    elif change == "second":
        vertices, faces = np.concatenate([vertices, vertices + [4, 0, 0]])[:42], faces
        vertices[:3] += [4, 0, 0]
    else:
        faces = faces[:, ::-1]
    table = {"kind": "mesh", "vertices": vertices.tolist(), "faces": faces.tolist()}
    assert not compiled({"shapes": [table]}).enclosures[0].convex


def test_a_far_triangle_does_not_make_a_crease_convex() -> None:
    """A floor and a wall at the origin, and a triangle a million units away: rounding there is none here."""
    far = 1e6
    vertices = [[0, 0, 0], [0.5, 0, 0], [0, 0, -0.5], [0, 0.5, 0]]
    vertices += [[-far, -far, 0], [-far, -far, -far], [1e5 - far, -far - 1e5, 0]]
    for faces in ([[0, 1, 2], [0, 2, 3], [4, 5, 6]], [[0, 2, 1], [0, 3, 2], [4, 6, 5]]):
        mesh = {"kind": "mesh", "vertices": vertices, "faces": faces}
        assert not compiled({"shapes": [mesh]}).enclosures[0].convex


@pytest.mark.slow
@pytest.mark.parametrize("precision", PRECISIONS)
def test_many_slivers_and_lights_and_points_inside(precision: str) -> None:
    for seed in range(2, 5):
        check_lone(precision, 200_000, 4, seed)
        check_inside(precision, 200_000, 2, seed)


@pytest.mark.parametrize("precision", PRECISIONS)
def test_a_sliver_and_a_light(precision: str) -> None:
    check_lone(precision, 80_000, 4)
