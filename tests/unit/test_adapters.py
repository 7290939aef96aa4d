"""The adapters to Mitsuba: every kind has one, and Mitsuba's answers carry our numbers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

import numpy as np
import pytest

import tracer
from reference.adapters import CAMERAS, body_of, points_of, without_adapter
from reference.adapters.extent import extent_of
from reference.adapters.geometry import Ball, Disk, Triangles
from reference.adapters.shapes import DISK_FACTOR, Surroundings
from reference.mitsuba_scene import MitsubaScene, build
from reference.mitsuba_variant import mitsuba
from tracer.camera import Camera
from tracer.canvas import Canvas
from tracer.device_meshes import placed_meshes
from tracer.errors import MachineError, UsageError
from tracer.lights import LIGHT_KINDS, LightRecord
from tracer.shapes import SHAPE_KINDS, ShapeRecord

CAMERA = {"resolution": [12, 9], "origin": [1.0, 2.0, 9.0], "target": [0.0, 0.5, 0.0], "fov": 40.0}
CANVAS_CAMERA = {
    "resolution": [12, 9],
    "position": [40.0, -30.0, 5.0],
    "rotate": [20.0, -15.0],
    "distance": 25.0,
    "pixel_size": 1.5,
}
DEGENERATE_FIRST = {
    "kind": "mesh",
    "name": "tent",
    "vertices": [[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0.5], [2, 1, 0.5]],
    "faces": [[0, 1, 2], [0, 2, 4, 3], [1, 1, 3]],
}
SHAPES: dict[str, list[dict[str, Any]]] = {
    "plane": [{"kind": "plane", "coefficients": [0, 2, 0, 1], "rotate": [0, 0, 90], "translate": [3, 0, 0]}],
    "sphere": [
        {"kind": "sphere", "center": [1, 0, 0], "radius": 0.5, "scale": 2, "rotate": [0, 0, 90]},
    ],
    "mesh": [DEGENERATE_FIRST | {"scale": 2, "translate": [0, 1, 0]}],
    "instance": [DEGENERATE_FIRST, {"kind": "instance", "of": "tent", "translate": [0, 0, -1]}],
}
LIGHTS: dict[str, dict[str, Any]] = {
    "point": {"position": [1, 2, 3]},
    "ring": {"center": [0, 5, 0], "normal": [0, 1, 0], "radius": 2},
    "disk": {"center": [0, 5, 0], "normal": [0, 1, 0], "radius": 2},
    "sphere": {"center": [0, 5, 0], "radius": 2},
    "rectangle": {"center": [0, 5, 0], "normal": [0, 1, 0], "size": [2, 4]},
}


def scene_of(shapes: list[dict[str, Any]], **keys: Any) -> tracer.Scene:
    return tracer.load({"camera": CAMERA, "shapes": shapes, **keys})


def body(scene: tracer.Scene, number: int) -> Any:
    meshes = placed_meshes(scene)
    extent = extent_of(scene, Canvas.of(scene.camera), meshes)
    return body_of(number, scene.shapes[number], Surroundings(scene, meshes, extent))


def mixed_scene() -> tracer.Scene:
    """Every kind of shape in mixed order, more planes and spheres than the kernel unrolls."""
    rng = np.random.default_rng(4)
    shapes: list[dict[str, Any]] = [
        DEGENERATE_FIRST,
        {"kind": "plane", "coefficients": [0, 1, 0, 40]},
        {"kind": "mesh", "vertices": [[0, 0, 0], [1, 1, 1], [2, 2, 2]], "faces": [[0, 1, 2]]},
        {"kind": "mesh", "builtin": "cube", "name": "cube", "rotate": [30, 20, 10], "translate": [-4, 1, 0]},
    ]
    for number in range(35):
        center = rng.uniform(-9, 9, 3).tolist()
        shapes.append({"kind": "sphere", "center": center, "radius": float(rng.uniform(0.2, 1.5))})
        if number % 5 == 0:
            shift = rng.uniform(-9, 9, 3).tolist()
            shapes.append({"kind": "instance", "of": ["cube", "tent"][number % 2], "translate": shift})
        normal = rng.normal(size=3)
        shapes.append(
            {"kind": "plane", "coefficients": [*normal.tolist(), 40 * float(np.linalg.norm(normal))]}
        )
    return scene_of(shapes)


@pytest.fixture(scope="module")
def mixed() -> Iterator[tuple[tracer.Scene, MitsubaScene]]:
    scene = mixed_scene()
    yield scene, build(scene)


def random_rays(n: int, size: float = 10.0) -> tuple[np.ndarray, np.ndarray]:
    """Origins and unit directions whose single precision values are exact."""
    rng = np.random.default_rng(11)
    o = rng.uniform(-size, size, (n, 3)).astype(np.float32).astype(np.float64)
    d = rng.normal(size=(n, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return o, d.astype(np.float32).astype(np.float64)


def height_error(t: np.ndarray, ours: Any, d: np.ndarray, both: np.ndarray) -> float:
    """The largest |dt cos theta| of the rays that `both` hit alike."""
    cosine = np.abs((d[both] * ours.normal[both]).sum(axis=1))
    return float((np.abs(t[both] - ours.t[both]) * cosine).max())


# ---- every kind has an adapter ----


def test_every_kind_has_an_adapter() -> None:
    assert without_adapter() == []
    assert list(CAMERAS) == [Camera]


def test_a_new_kind_without_adapter_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    class Cone(ShapeRecord):
        kind: Literal["cone"] = "cone"

    class Laser(LightRecord):
        kind: Literal["laser"] = "laser"

    monkeypatch.setitem(SHAPE_KINDS, "cone", Cone)
    monkeypatch.setitem(LIGHT_KINDS, "laser", Laser)
    assert without_adapter() == ["shape cone", "light laser"]
    scene = scene_of([])
    with pytest.raises(UsageError, match='^Mitsuba has no counterpart of "cone": '):
        body_of(0, Cone(), Surroundings(scene, {}, 1.0))
    with pytest.raises(UsageError, match='"laser"'):
        points_of(Laser())


def test_the_tables_of_this_file_walk_all_kinds() -> None:
    assert set(SHAPES) == set(SHAPE_KINDS)
    assert set(LIGHTS) == set(LIGHT_KINDS)


# ---- bodies ----


def test_a_plane_becomes_a_large_disk() -> None:
    scene = scene_of(SHAPES["plane"])
    disk = body(scene, 0)
    assert isinstance(disk, Disk)
    np.testing.assert_allclose(disk.normal, [-1, 0, 0], atol=1e-15)  # y turned about z
    assert disk.d == pytest.approx(0.5 + 3)
    assert disk.radius == DISK_FACTOR * 9
    np.testing.assert_allclose(disk.to_world() @ disk.to_object(), np.eye(4), atol=1e-12)
    center = disk.to_world()[:3, 3]
    assert disk.normal @ center + disk.d == pytest.approx(0)
    assert np.linalg.det(disk.to_world()[:3, :3]) == pytest.approx(disk.radius**2)


def test_a_sphere_is_placed() -> None:
    ball = body(scene_of(SHAPES["sphere"]), 0)
    assert isinstance(ball, Ball)
    np.testing.assert_allclose(ball.center, [0, 2, 0], atol=1e-15)
    assert ball.radius == 1


def test_a_mesh_loses_its_degenerate_triangles_and_keeps_its_numbers() -> None:
    triangles = body(scene_of(SHAPES["mesh"]), 0)
    assert isinstance(triangles, Triangles)
    assert triangles.numbers.tolist() == [1, 2]
    assert triangles.corners.tolist() == [
        [[0, 1, 0], [4, 1, 0], [4, 3, 1]],
        [[0, 1, 0], [4, 3, 1], [0, 3, 1]],
    ]
    assert triangles.corner_normals is None


def test_an_instance_has_triangles_of_its_own() -> None:
    triangles = body(scene_of(SHAPES["instance"]), 1)
    assert isinstance(triangles, Triangles)
    assert triangles.corners[0].tolist() == [[0, 0, -1], [2, 0, -1], [2, 1, -0.5]]


@pytest.mark.parametrize("kind", LIGHT_KINDS)
def test_a_light_is_its_samples(kind: str) -> None:
    scene = scene_of([], lights=[{"kind": kind, **LIGHTS[kind]}])
    points = points_of(scene.lights[0])
    assert points.shape == ((1 if kind == "point" else 16), 3)
    if kind == "point":
        assert points.tolist() == [[1, 2, 3]]
        return
    away = np.linalg.norm(points - [0, 5, 0], axis=1)
    assert away.max() <= (np.hypot(1, 2) if kind == "rectangle" else 2) + 1e-12
    if kind in ("ring", "sphere"):
        np.testing.assert_allclose(away, 2)


# ---- the camera ----


@pytest.mark.parametrize("camera", [CAMERA, CANVAS_CAMERA], ids=["look-at", "canvas"])
@pytest.mark.parametrize(("supersample", "offset"), [(1, 0.5), (1, 0.0), (2, 0.5), (3, 0.2)])
def test_the_sensor_sends_the_rays_of_the_model(
    camera: dict[str, Any], supersample: int, offset: float
) -> None:
    scene = tracer.load({"camera": {**camera, "pixel_offset": offset}})
    there = build(scene, supersample)
    canvas = Canvas.of(scene.camera)
    row, column, b, a = (
        index.ravel() for index in np.indices((9, 12, supersample, supersample), dtype=np.float64)
    )
    x = (column + (a + offset) / supersample - 6) * canvas.pixel_size
    y = (row + (b + offset) / supersample - 4.5) * canvas.pixel_size
    across = x[:, None] * canvas.x + y[:, None] * canvas.y
    d = canvas.distance * canvas.forward + across
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    origins, directions = there.camera_rays()
    np.testing.assert_allclose(directions, d, rtol=0, atol=5e-7)
    np.testing.assert_allclose(origins, canvas.center + across, rtol=0, atol=1e-6 * there.extent)


@pytest.mark.parametrize("offset", [0.5, 0.0])
@pytest.mark.parametrize("supersample", [1, 2])
def test_the_depth_buffer_is_the_distance_from_the_canvas(offset: float, supersample: int) -> None:
    scene = tracer.load(
        {
            "camera": {"resolution": [16, 12], "distance": 20, "pixel_offset": offset},
            "shapes": [{"kind": "sphere", "center": [1, 0, -30], "radius": 12}],
        }
    )
    depth = build(scene, supersample).depth_buffer()
    ours = tracer.render(scene, precision="double", supersample=1).depth
    assert depth.shape == (12, 16)
    assert (depth == -1).any() and (depth > 0).any()
    np.testing.assert_array_equal(depth == -1, ours == -1)
    np.testing.assert_allclose(depth, ours, rtol=1e-5)


# ---- hits ----


def test_hits_carry_our_numbers(mixed: tuple[tracer.Scene, MitsubaScene]) -> None:
    scene, there = mixed
    o, d = random_rays(20_000)
    hits, ours = there.intersect(o, d), tracer.intersect(scene, o, d)
    same = (hits.shape == ours.shape) & (hits.primitive == ours.primitive)
    assert np.count_nonzero(~same) <= 3  # rays along a silhouette
    met = {scene.shapes[number].kind for number in np.unique(ours.shape[ours.valid])}
    assert met == set(SHAPE_KINDS)
    both = same & ours.valid
    assert height_error(hits.t, ours, d, both) <= 1e-6 * there.extent
    np.testing.assert_allclose(hits.n[both], ours.normal[both], rtol=0, atol=2e-4)
    np.testing.assert_array_equal(hits.p[both], (o + hits.t[:, None] * d)[both])
    preliminary = there.lookup(there.scene.ray_intersect_preliminary(there.rays(o, d)))
    np.testing.assert_array_equal(preliminary, (hits.shape, hits.primitive))


def test_a_fresh_scene_does_not_shift_the_numbers(mixed: tuple[tracer.Scene, MitsubaScene]) -> None:
    o, d = random_rays(200)
    before = mixed[1].intersect(o, d).shape
    others = [build(mixed[0]), build(scene_of(SHAPES["mesh"]))]
    np.testing.assert_array_equal(mixed[1].intersect(o, d).shape, before)
    np.testing.assert_array_equal(others[0].intersect(o, d).shape, before)


def test_numbers_follow_the_order_of_mitsuba(mixed: tuple[tracer.Scene, MitsubaScene]) -> None:
    scene, there = mixed
    assert sorted(there.numbers) == [n for n in range(len(scene.shapes)) if n != 2]  # 2 is all degenerate


def test_a_limit_and_a_miss() -> None:
    there = build(scene_of([{"kind": "sphere", "center": [0, 0, 0], "radius": 1}]))
    hits = there.intersect([[0, 0, 5]] * 3, [[0, 0, -1], [0, 0, -1], [0, 1, 0]], t_max=[4.5, 3.5, 100])
    assert hits.shape.tolist() == [0, -1, -1] and hits.primitive.tolist() == [0, -1, -1]
    assert hits.t.tolist() == [4, np.inf, np.inf]
    assert hits.n[0].tolist() == [0, 0, 1] and np.isnan(hits.n[1:]).all() and np.isnan(hits.p[1:]).all()


@pytest.mark.parametrize("shapes", [[], SHAPES["sphere"]], ids=["empty", "sphere"])
def test_no_rays_and_no_shapes(shapes: list[dict[str, Any]]) -> None:
    there = build(scene_of(shapes))
    assert there.intersect(np.zeros((0, 3)), np.zeros((0, 3))).t.shape == (0,)
    assert there.visible(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)
    assert there.intersect([[9, 9, 9]], [[0, 1, 0]]).valid.tolist() == [False]
    assert there.visible([[9, 9, 9]], [[9, 12, 9]]).tolist() == [True]


def test_visibility(mixed: tuple[tracer.Scene, MitsubaScene]) -> None:
    scene, there = mixed
    p, q = random_rays(5000)[0], random_rays(5000)[0][::-1]
    free = there.visible(p, q)
    assert 0.1 < free.mean() < 0.9
    assert np.count_nonzero(free != tracer.visible(scene, p, q)) <= 2


def test_smooth_normals_leave_the_geometry_alone() -> None:
    cube = {"kind": "mesh", "builtin": "cube"}
    flat, smooth = (build(scene_of([cube | {"smooth": smooth}])) for smooth in (False, True))
    o, d = random_rays(500, 0.9)
    np.testing.assert_array_equal(flat.intersect(o, d).n, smooth.intersect(o, d).n)


@pytest.mark.parametrize("size", [1e-3, 1e9])
def test_scenes_of_any_size(size: float) -> None:
    shapes = [
        {"kind": "plane", "coefficients": [0, 1, 0, 3 * size]},
        {"kind": "sphere", "center": [0, 0, 0], "radius": size},
        {"kind": "mesh", "builtin": "tetrahedron", "scale": size, "translate": [3 * size, 0, 0]},
    ]
    camera = {"resolution": [4, 3], "distance": 20 * size, "pixel_size": size, "position": [0, 0, 5 * size]}
    scene = tracer.load({"camera": camera, "shapes": shapes})
    there = build(scene)
    o, d = random_rays(2000, 4.0)
    o = (o * size).astype(np.float32).astype(np.float64)
    hits, ours = there.intersect(o, d), tracer.intersect(scene, o, d)
    assert np.count_nonzero(hits.shape != ours.shape) <= 2
    both = (hits.shape == ours.shape) & ours.valid
    assert height_error(hits.t, ours, d, both) <= 1e-6 * there.extent
    depth = tracer.render(scene, precision="double").depth
    np.testing.assert_allclose(there.depth_buffer(), depth, rtol=1e-4)


def test_without_mitsuba(monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "mitsuba", None)
    with pytest.raises(MachineError, match=r"^Mitsuba is not installed; `pip install whitted-tracer\[ref"):
        mitsuba()
