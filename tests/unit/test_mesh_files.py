"""Mesh files: small ugly ones with known contents, broken ones with their sentences, and the plain reader."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from reference import plain_files
from tracer.errors import SceneError
from tracer.shapes import Mesh
from tracer.shapes.triangles import BUILTIN_MESHES, place_mesh, read_mesh

TOWER = """\
# two objects, all forms of corners, polygons of every size
v 0 0 0 1.0
v 2 0 0 0.5 0.5 0.5
v 2 2 0
v 0 2 0
v 1 3 0
vt 0 0
vn 0 0 1
o first
g a b
usemtl none
f 1//1 2//1 3//1 4//1
s off
f 4/1 3/1 5/1
o second
v 0 0 1
v 1 0 1
v 0 1 1
f -3/1/1 -2/1/1 \\
  -1/1/1
f 1 2 3 5 4
"""


def read(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, triangles and face numbers of a file."""
    data = read_mesh(Mesh(file=path.name), path, "mesh")
    return data.vertices, data.triangles, data.faces


def write(folder: Path, name: str, text: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_obj_of_every_form(tmp_path: Path, newline: str, mark: str) -> None:
    """Fans in file order; a line may go on after a backslash, numbers may count back."""
    vertices, triangles, faces = read(write(tmp_path, "tower.obj", mark + TOWER.replace("\n", newline)))
    assert vertices.shape == (8, 3) and vertices[1].tolist() == [2, 0, 0]
    expected = [[0, 1, 2], [0, 2, 3], [3, 2, 4], [5, 6, 7], [0, 1, 2], [0, 2, 4], [0, 4, 3]]
    assert triangles.tolist() == expected
    assert faces.tolist() == [0, 0, 1, 2, 3, 3, 3]


def test_a_face_may_name_a_vertex_that_comes_later(tmp_path: Path) -> None:
    _, triangles, _ = read(write(tmp_path, "late.obj", "v 0 0 0\nf 1 2 3\nv 1 0 0\nv 0 1 0\n"))
    assert triangles.tolist() == [[0, 1, 2]]


def test_normals_count_only_when_every_corner_has_one(tmp_path: Path) -> None:
    """All or nothing: one corner without a normal, and the area-weighted ones are used."""
    base = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nvn 1 0 0\n"
    whole = write(tmp_path, "whole.obj", base + "f 1//1 2//1 3//1\nf 2//1 4//1 3//1\n")
    partly = write(tmp_path, "partly.obj", base + "f 1//1 2//1 3//1\nf 2//1 4//1 3\n")
    mesh = Mesh(file="x.obj")
    assert (read_mesh(mesh, whole, "m").normals == [1, 0, 0]).all()
    assert not read_mesh(mesh, partly, "m").normals.any()
    placed = place_mesh(read_mesh(mesh, partly, "m"), mesh.placement)
    np.testing.assert_allclose(placed.corner_normals[0, 0], [0, 0, 1], atol=1e-15)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.obj", "", r"a\.obj has no faces"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", r"a\.obj has no faces"),
        ("a.obj", "v 0 0 0\nf 1 1\n", r"a\.obj, line 2: has fewer than three corners"),
        ("a.obj", "v 0 0\n", r"a\.obj, line 1: `v` needs three numbers"),
        ("a.obj", "v 0 0 x\n", r"a\.obj, line 1: `v 0 0 x` is not three numbers"),
        ("a.obj", "v 0 0 0\nf 1 2 a\n", r"a\.obj, line 2: `a` is no corner"),
        ("a.obj", "v 0 0 0\nf 1 0 1\n", r"a\.obj, line 2: vertex 0 does not exist"),
        ("a.obj", "v 0 0 0\nf -1 -2 -1\n", r"a\.obj, line 2: vertex -2 does not exist"),
        ("a.obj", "v 0 0 0\nf 1 1 9\n", r"face 0 names vertex 8, counted from 0; the file has 1"),
        ("a.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "a vertex is not finite"),
        ("a.obj", "v 1e39 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "leaves the range of single precision"),
        ("a.ply", "", "it has no PLY header"),
        ("a.ply", "ply\nformat ascii 1.0\nend_header\n", r"is damaged or no PLY file \('vertex'\)"),
        ("a.ply", "ply\nformat utf8 1.0\nend_header\n", "its format is utf8"),
        (
            "a.ply",
            "ply\nformat binary_little_endian 1.0\nelement vertex 2147483648\nproperty float x\nend_header\n",
            "it ends before its 2147483648 entries of `vertex`",
        ),
    ],
)
def test_a_broken_file_is_one_sentence(tmp_path: Path, name: str, text: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        read(write(tmp_path, name, text))


def test_binary_garbage_and_folders_are_refused(tmp_path: Path) -> None:
    garbage = bytes(range(256)) * 8
    for name in ("x.obj", "x.ply"):
        with pytest.raises(SceneError, match=r"x\.(obj|ply)"):
            read(write(tmp_path, name, garbage))
    (tmp_path / "folder.obj").mkdir()
    with pytest.raises(SceneError, match="cannot be read"):
        read(tmp_path / "folder.obj")


POINTS = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.25), (1.0, 1.0, 0.5), (0.0, 1.0, 0.75), (0.5, 2.0, 1.0)]
POLYGONS = [(0, 1, 2, 3), (3, 2, 4), (0, 1, 2, 4, 3)]


def ply(form: str, with_normals: bool) -> bytes:
    """The same five points and three polygons of different sizes in any form of PLY, with an odd element."""
    normals = "property float nx\nproperty float ny\nproperty float nz\n" if with_normals else ""
    header = (
        f"ply\nformat {form} 1.0\ncomment odd\nelement vertex 5\nproperty uchar tag\nproperty double y\n"
        f"property float x\nproperty float z\n{normals}element extra 1\nproperty list uchar short values\n"
        "element face 3\nproperty uchar flag\nproperty list uchar int vertex_indices\nend_header\n"
    )
    order = ">" if form == "binary_big_endian" else "<"
    body = b""
    rows: list[tuple[str, tuple[float, ...]]] = []
    for x, y, z in POINTS:
        rows.append(("Bdff" + ("fff" if with_normals else ""), (7, y, x, z, *((0, 0, 1) * with_normals))))
    rows.append(("B3h", (3, -1, -2, -3)))
    rows += [(f"BB{len(p)}i", (1, len(p), *p)) for p in POLYGONS]
    for layout, values in rows:
        text = " ".join(str(value) for value in values) + "\n"
        body += text.encode() if form == "ascii" else struct.pack(order + layout, *values)
    return header.encode() + body


@pytest.mark.parametrize("with_normals", [False, True])
@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_of_every_form(tmp_path: Path, form: str, with_normals: bool) -> None:
    """Polygons of mixed sizes stay in the file's order, in every byte order."""
    path = write(tmp_path, "a.ply", ply(form, with_normals))
    data = read_mesh(Mesh(file="a.ply"), path, "m")
    assert data.vertices.tolist() == [list(p) for p in POINTS]
    assert data.faces.tolist() == [0, 0, 1, 2, 2, 2]
    assert bool(data.normals.any()) == with_normals
    plain = plain_files.read_mesh(path)
    assert data.triangles.tolist() == [list(t) for t in plain.triangles]
    assert data.vertices.tolist() == [list(v) for v in plain.vertices]


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
def test_every_shortened_ply_is_refused(tmp_path: Path, form: str) -> None:
    """Cut anywhere in its body, a file is an error, never fewer triangles."""
    whole = ply(form, False)
    start = whole.index(b"end_header\n") + len(b"end_header\n")
    last = len(whole) - (3 if form == "ascii" else 1)
    for end in range(start, last, 7):
        with pytest.raises(SceneError, match="a.ply"):
            read(write(tmp_path, "a.ply", whole[:end]))


def test_the_plain_reader_agrees_on_obj(tmp_path: Path) -> None:
    path = write(tmp_path, "tower.obj", TOWER)
    vertices, triangles, _ = read(path)
    plain = plain_files.read_mesh(path)
    assert triangles.tolist() == [list(t) for t in plain.triangles]
    assert vertices.tolist() == [list(v) for v in plain.vertices]


@pytest.mark.parametrize("kind", ["cube", "tetrahedron"])
def test_builtin_meshes_are_closed_and_face_outward(kind: str) -> None:
    """Every edge is shared by two faces that run along it in opposite ways; the volume is positive."""
    data = read_mesh(Mesh(builtin=kind), None, "m")
    corners = data.vertices[data.triangles]
    edges = {tuple(sorted((t[k], t[k - 2]))): 0 for t in data.triangles.tolist() for k in range(3)}
    for t in data.triangles.tolist():
        for k in range(3):
            edges[tuple(sorted((t[k], t[k - 2])))] += 1 if t[k] < t[k - 2] else -1
    assert set(edges.values()) == {0}
    volume = np.linalg.det(corners).sum() / 6
    assert volume == pytest.approx(8 if kind == "cube" else 8 / 3)
    assert [list(t) for t in plain_files.BUILTIN_MESHES[kind].triangles] == data.triangles.tolist()
    assert len(BUILTIN_MESHES[kind][1]) == (6 if kind == "cube" else 4)


@pytest.mark.parametrize("size", [1e-18, 1e-6, 1.0, 1e6, 1e18])
def test_normals_are_unit_at_every_scale(size: float) -> None:
    """Neither do squares vanish for tiny triangles nor overflow for huge ones."""
    mesh = Mesh(vertices=[[0, 0, 0], [size, 0, 0], [0, size, 0]], faces=[[0, 1, 2]])
    placed = place_mesh(read_mesh(mesh, None, "m"), mesh.placement)
    assert placed.normals.tolist() == [[0, 0, 1]]


def test_a_degenerate_triangle_keeps_its_number_and_has_no_normal() -> None:
    mesh = Mesh(vertices=[[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]], faces=[[0, 1, 2], [0, 1, 3]])
    placed = place_mesh(read_mesh(mesh, None, "m"), mesh.placement)
    assert placed.normals.tolist() == [[0, 0, 0], [0, 0, 1]]
