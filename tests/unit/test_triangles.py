"""Triangles of a mesh: cut, rounded and placed, with normals that are right for slivers of every size."""

from __future__ import annotations

from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
import pytest

from reference import plain_files
from tracer.placement import Placement
from tracer.shapes import Mesh
from tracer.shapes.repetitions import repeated
from tracer.shapes.triangles import MeshData, place_mesh, read_mesh

STILL = Mesh(builtin="cube").placement
ULP = 2.0**-53  # of the numbers from 1/2 to 1, which the largest components of unit vectors are


def triangles(corners: np.ndarray) -> MeshData:
    """Single triangles (m, 3, 3) that share no vertex."""
    count = len(corners)
    return MeshData(
        corners.reshape(-1, 3).astype(np.float32).astype(np.float64),
        np.arange(3 * count).reshape(-1, 3),
        np.arange(count),
        np.zeros((0, 3, 3)),
    )


def exact_normal(corners: np.ndarray) -> list[Decimal]:
    """The unit normal to 60 digits, from rational numbers; zero for a degenerate triangle."""
    a, b, c = ([Fraction(x) for x in corner] for corner in corners.tolist())
    (ux, uy, uz), (vx, vy, vz) = ([q - p for p, q in zip(a, end, strict=True)] for end in (b, c))
    area = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx]
    largest = max(map(abs, area))
    if largest == 0:
        return [Decimal(0)] * 3
    with localcontext() as context:
        context.prec = 60
        scaled = [x / largest for x in area]
        numbers = [Decimal(x.numerator) / Decimal(x.denominator) for x in scaled]
        length = sum(x * x for x in numbers).sqrt()
        return [x / length for x in numbers]


def worst_error(corners: np.ndarray) -> float:
    """The largest error of a component of a normal, in ulp; degenerate triangles must be found exactly."""
    data = triangles(corners)
    placed, worst = place_mesh(data, STILL), 0.0
    for found, its_corners in zip(placed.normals, placed.corners, strict=True):
        exact = exact_normal(its_corners)
        assert found.any() == any(exact)
        errors = [abs(Decimal(x) - y) for x, y in zip(found.tolist(), exact, strict=True)]
        worst = max(worst, float(max(errors)) / ULP)
    return worst


def slivers(rng: np.random.Generator, count: int) -> np.ndarray:
    """The third corner lies on the line through the others, but for the rounding to single precision."""
    a, b = rng.normal(size=(2, count, 3))
    return np.stack([a, b, a + rng.uniform(-1, 2, (count, 1)) * (b - a)], axis=1)


@pytest.mark.parametrize("scale", [1e-38, 1e-18, 1.0, 1e18, 1e37])
def test_normals_of_slivers(scale: float) -> None:
    assert worst_error(scale * slivers(np.random.default_rng(1), 200)) <= 4


def test_normals_where_edges_are_no_doubles() -> None:
    """Coordinates of 1e-30 beside those of 1e10: b - a rounds, and so do all products."""
    rng = np.random.default_rng(2)
    corners = rng.normal(size=(600, 3, 3)) * 10.0 ** rng.integers(-30, 11, (600, 3, 3))
    corners[300:, 2] = corners[300:, 1] + (corners[300:, 1] - corners[300:, 0]) * 2.0 ** rng.integers(
        -3, 3, (300, 1)
    )
    assert worst_error(corners) <= 4


def test_a_triangle_is_degenerate_only_when_it_is() -> None:
    """a = (e, e + d), e = 2^-60, d = 2^-83, off the line through b and c: area d, from products near 2."""
    e, above, below = 2.0**-60, 2.0**-60 * (1 + 2.0**-23), 2.0**-60 * (1 - 2.0**-23)
    thin = np.array([[[e, y, 0], [1, 1, 0], [2, 2, 0]] for y in (above, below)])
    flat = np.array(
        [[[e, e, 0], [1, 1, 0], [3, 3, 0]], [[1, 2, 3]] * 3, [[0, 0, 0], [e, 1, 3], [2 * e, 2, 6]]]
    )
    assert place_mesh(triangles(thin), STILL).normals.tolist() == [[0, 0, 1], [0, 0, -1]]
    assert not place_mesh(triangles(flat), STILL).normals.any()


def test_degenerate_triangles_keep_their_number() -> None:
    mesh = Mesh(
        vertices=[[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]],
        faces=[[0, 1, 2], [0, 2, 3], [0, 1, 1], [0, 1, 3]],
    )
    data = read_mesh(mesh, None, "m")
    assert data.faces.tolist() == [0, 1, 2, 3]
    assert data.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 1], [0, 1, 3]]
    placed = place_mesh(data, STILL)
    assert placed.normals[:, 2].tolist() == [0, 1, 0, 1]
    assert placed.in_hierarchy.tolist() == [False, True, False, True]


def test_repetitions_are_found_whatever_their_winding() -> None:
    """Also with the other zero, and by place, not by vertex number; one corner more does not make a pair."""
    a, b, c, d = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]
    corners = np.array([[a, b, c], [b, c, a], [c, b, a], [a, b, d], [[-0.0, 0.0, -0.0], b, d], [a, c, d]])
    assert repeated(corners).tolist() == [False, True, True, False, True, False]
    rng = np.random.default_rng(3)
    soup = rng.integers(0, 4, (3000, 3, 3)).astype(float)
    keys = [tuple(sorted(map(tuple, t))) for t in soup.tolist()]
    assert repeated(soup).tolist() == [key in keys[:k] for k, key in enumerate(keys)]


def test_a_mesh_of_nothing_but_degenerate_triangles_keeps_one() -> None:
    mesh = Mesh(vertices=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], faces=[[0, 1, 2], [2, 1, 0]])
    placed = place_mesh(read_mesh(mesh, None, "m"), STILL)
    assert placed.in_hierarchy.tolist() == [True, False]


def test_vertices_are_rounded_as_read_and_as_placed() -> None:
    """1/3 in single precision, and that times 3 plus 1/3 in double precision, rounded once more."""
    third = float(np.float32(1 / 3))
    mesh = Mesh(
        vertices=[[1 / 3, 0, 0], [1, 0, 0], [0, 1, 0]], faces=[[0, 1, 2]], scale=3, translate=(1 / 3, 0, 0)
    )
    data = read_mesh(mesh, None, "m")
    assert data.vertices[0, 0] == third
    assert place_mesh(data, mesh.placement).corners[0, 0, 0] == np.float32(3 * third + 1 / 3)


def test_a_placement_out_of_range_is_infinite_and_quiet() -> None:
    """The compiler of scenes refuses it by name; here it neither warns nor looks like a usable triangle."""
    data = triangles(np.array([[[0, 0, 0], [1, 0, 0], [0, 3e38, 0]]]))
    placed = place_mesh(data, Placement.of(9.0, (0, 0, 0), (0, 0, 0)))
    assert placed.corners[0, 2].tolist() == [0, np.inf, 0]


def test_vertex_normals_are_weighted_by_area_per_vertex_number() -> None:
    """Vertices at the same place with different numbers keep a crease; placing turns the sums."""
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 3], [0, 0, 0], [1, 0, 0]]
    mesh = Mesh(vertices=vertices, faces=[[0, 1, 2], [0, 3, 1], [4, 5, 2]], rotate=(0, 0, 90), smooth=True)
    found = place_mesh(read_mesh(mesh, None, "m"), mesh.placement).corner_normals
    shared = np.array([-3, 0, 1]) / 10**0.5  # (0, 0, 1) and (0, 3, 0), turned
    np.testing.assert_allclose(found[0], [shared, shared, [0, 0, 1]], atol=1e-15)
    np.testing.assert_allclose(found[1], [shared, [-1, 0, 0], shared], atol=1e-15)
    np.testing.assert_allclose(found[2], [[0, 0, 1]] * 3, atol=1e-15)


def test_the_faces_of_the_cube_follow_the_axes() -> None:
    """-x +x -y +y -z +z, two triangles each, and the corners of the plain version in its order."""
    data = read_mesh(Mesh(builtin="cube"), None, "m")
    axes = np.repeat([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]], 2, axis=0)
    assert np.array_equal(place_mesh(data, STILL).normals, axes)
    assert data.faces.tolist() == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5]
    assert data.vertices.tolist() == [list(v) for v in plain_files.BUILTIN_MESHES["cube"].vertices]


def test_face_k_of_the_tetrahedron_is_opposite_to_corner_k() -> None:
    data = read_mesh(Mesh(builtin="tetrahedron"), None, "m")
    assert data.vertices.tolist() == [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
    assert np.allclose(place_mesh(data, STILL).normals, -data.vertices / 3**0.5, rtol=0, atol=1e-15)
    assert data.vertices.tolist() == [list(v) for v in plain_files.BUILTIN_MESHES["tetrahedron"].vertices]
