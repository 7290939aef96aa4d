"""Every file of the conformance set: what is read, what the plain version reads, and what is traced."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tracer
from reference import plain, plain_files
from tests.unit.ugly_meshes import UGLY, Ugly
from tracer.scene_warnings import warnings_of
from tracer.shapes import Mesh
from tracer.shapes.triangles import MeshData, place_mesh, read_mesh


def written(folder: Path, ugly: Ugly) -> Path:
    """The path of the file, with those that it names beside it."""
    for name, content in (ugly.beside | {ugly.file: ugly.content}).items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder / ugly.file


def read(path: Path) -> MeshData:
    return read_mesh(Mesh(file=path.name), path, "m")


@pytest.mark.parametrize("name", UGLY)
def test_counts_order_and_numbers(tmp_path: Path, name: str) -> None:
    ugly = UGLY[name]
    data = read(written(tmp_path, ugly))
    assert data.vertices.shape == (len(ugly.vertices), 3) and data.vertices.dtype == np.float64
    assert data.vertices.tolist() == np.array(ugly.vertices, np.float32).astype(float).tolist()
    assert data.triangles.tolist() == ugly.triangles
    assert data.faces.tolist() == ugly.faces
    assert bool(len(data.normals)) == ugly.with_normals


@pytest.mark.parametrize("name", UGLY)
def test_the_plain_reader_finds_the_same(tmp_path: Path, name: str) -> None:
    path = written(tmp_path, UGLY[name])
    data, plain = read(path), plain_files.read_mesh(path)
    assert np.array_equal(np.array(plain.vertices, np.float32), data.vertices)
    assert [list(t) for t in plain.triangles] == data.triangles.tolist()
    assert np.array_equal(data.normals, np.array(plain.corner_normals or np.zeros((0, 3, 3))))


def test_the_same_mesh_in_every_format_is_the_same_picture(tmp_path: Path) -> None:
    """Flat and smooth; hits and colors bit for bit. STL smooths by place, the others by vertex number."""
    names = ("quad.obj", "binary.stl", "ascii.stl", "plain.gltf", "plain.glb", "beside.gltf", "sparse.glb")
    camera = {"resolution": [24, 18], "origin": [0.4, 0.3, 3], "target": [0.5, 0.5, 0], "fov": 30.0}
    rng = np.random.default_rng(5)
    origins = rng.uniform(-0.2, 1.2, (200, 3)) + [0, 0, 2]
    for smooth in (False, True):
        found = []
        for name in names:
            content = UGLY[name].content
            if name == "quad.obj":
                content = str(content).replace("f 4 3 2 1\n", "")
            written(tmp_path, Ugly(name, content, [], [], [], beside=UGLY[name].beside))
            shape = {"kind": "mesh", "file": name, "smooth": smooth, "rotate": [10, 20, 30]}
            light = {"kind": "point", "position": [3, 4, 5]}
            scene = tracer.load({"camera": camera, "lights": [light], "shapes": [shape]}, base_dir=tmp_path)
            hits = tracer.intersect(scene, origins, np.tile([0.01, 0.02, -1.0], (200, 1)))
            found.append((tracer.render(scene).color.tobytes(), hits.t.tobytes(), hits.primitive.tobytes()))
        assert len(set(found)) == 1


def test_stl_is_smoothed_by_place(tmp_path: Path) -> None:
    """Two facets at a right angle: the corners on their edge share a normal, though not a number."""
    text = UGLY["ascii.stl"].content
    assert isinstance(text, str)
    path = written(tmp_path, Ugly("a.stl", text.replace("vertex 0 1 0", "vertex 1 0 1"), [], [], []))
    data = read(path)
    assert data.places is not None and data.places.tolist() == [0, 1, 2, 0, 2, 5]
    normals = place_mesh(data, Mesh(file="a.stl").placement).corner_normals
    assert np.array_equal(normals[0, 0], normals[1, 0]) and np.array_equal(normals[0, 2], normals[1, 1])
    assert not np.array_equal(normals[0, 1], normals[0, 0])


def test_what_is_never_hit_is_told_once(tmp_path: Path) -> None:
    """One sentence for the mesh and its instance; both copies and both windings count as one surface."""
    written(tmp_path, UGLY["again.obj"])
    shapes = [
        {"kind": "mesh", "name": "it", "file": "again.obj"},
        {"kind": "instance", "of": "it", "translate": [0, 0, -1]},
        {"kind": "plane", "coefficients": [0, 0, 1, 2]},
    ]
    camera = {"resolution": [8, 8], "origin": [0.6, 0.3, 3], "target": [0.6, 0.3, 0], "fov": 30.0}
    scene = tracer.load({"camera": camera, "shapes": shapes}, base_dir=tmp_path)
    assert warnings_of(scene) == [
        "scene: `shapes.it` (again.obj), of 4 triangles, has 1 without area (the first is 1) and 2 with the "
        "corners of another (the first is 2), which keep their numbers and are never hit"
    ]
    for z in (1, -0.5):
        hits = tracer.intersect(scene, [[0.6, 0.3, z]] * 2, [[0, 0, -1], [0, 0, 1]])
        assert hits.primitive[0] == 0 and hits.primitive[1] in (0, -1)
    glass = [shape | {"material": "glass"} for shape in shapes[:2]]
    lit = {
        "camera": camera | {"resolution": [4, 4]},
        "transparent_shadows": True,
        "lights": [{"kind": "point", "position": [0.6, 0.3, 9]}],
        "materials": {"glass": {"refraction": 0.5, "diffuse": 0.0}},
        "shapes": [*glass, {"kind": "plane", "coefficients": [0, 0, 1, 2]}],
        "ambient": 0.0,
    }
    found = tracer.render(tracer.load(lit, base_dir=tmp_path), precision="double").color
    expected = plain.render(plain.load(lit, tmp_path)).color
    assert 0 < expected[..., 0].min() < 0.3  # two panes of glass are between, not six
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7)
