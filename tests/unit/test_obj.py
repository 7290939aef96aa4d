"""Odd but legal OBJ files with what they hold, and broken ones with the sentence that names the line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reference import plain_files
from tracer.errors import SceneError
from tracer.shapes import Mesh
from tracer.shapes.obj import read_obj
from tracer.shapes.triangles import place_mesh, read_mesh

THREE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def write(folder: Path, text: str | bytes) -> Path:
    path = folder / "a.obj"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize(
    "text",
    [
        THREE + "f 1 2 3",
        THREE.replace("\n", "\r") + "f 1 2 3\r",
        THREE + "f 1 2 \\\r\n 3\r\n",
        THREE + "f 1 2 \\  \n 3\n",
        THREE + "f 1 2 3 \\",
        THREE + "f \\\n1 \\\n2 \\\n3",
        THREE + "# a comment goes on after no backslash \\\nf 1 2 3 # nor here\n",
        THREE + "\t f\t+1 \x0c 2   3 \n",
        THREE + "# a line\u2028separator\x85 in a comment\nf 1 2 3\n",
        THREE.encode() + b"o caf\xe9\n\0\0\nf 1 2 3\n",
        "vt 0 0\nvp 0 1\nl 1 2\np 1\nmtllib a.mtl\ns 1\n" + THREE + "usemtl x\nf 1/ 2/7 3/x\n",
        "v 0 0 0 nan red\nv 1e0 .0 0. 1 1 1\nv 0 +1 -0 1.0\nf 1// 2// 3//\n",
        "f 1 2 3\n" + THREE,
        "v 0 0 0\nv 1 0 0\nf -2 -1 3\nv 0 1 0\n",
    ],
)
def test_odd_files_are_one_triangle(tmp_path: Path, text: str | bytes) -> None:
    soup = read_obj(write(tmp_path, text))
    assert soup.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert soup.faces == [[0, 1, 2]]
    assert not soup.has_all_normals


def test_numbers_count_back_from_the_face_and_not_from_the_end(tmp_path: Path) -> None:
    """Vertices and normals count each for themselves; both numbers of a corner may be negative."""
    text = THREE + "vn 0 0 1\nf -3//-1 -2//-1 -1//-1\nv 5 5 5\nvn 0 1 0\nvn 1 0 0\nf -1//-2 -2/9/3 1//1\n"
    soup = read_obj(write(tmp_path, text))
    assert soup.faces == [[0, 1, 2], [3, 2, 0]]
    assert soup.face_normals == [[0, 0, 0], [1, 2, 0]]
    assert soup.has_all_normals


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("f 1 2 \\\n 9\n", r"line 4: face 0 names vertex 8, counted from 0; the file has 3$"),
        ("f 1 2 3\n\nf 1 3 2 4\n", r"line 6: face 1 names vertex 3, counted from 0; the file has 3$"),
        ("f 1//1 2//1 3//1\n", r"line 4: face 0 names normal 0, counted from 0; the file has 0$"),
        ("vn 0 0 1\nf 1//1 2//1 3//-2\n", r"line 5: normal -2 does not exist$"),
        ("vn 0 0 1\nf 1//1 2//1 3//0\n", r"line 5: normal 0 does not exist$"),
        ("f 1 2 0/1/1\n", r"line 4: vertex 0 does not exist$"),
        ("f 1 2 -4\nv 0 0 0\n", r"line 4: vertex -4 does not exist$"),
        (f"f 1 2 {'9' * 99}\n", r"line 4: face 0 names vertex \d+, counted from 0; the file has 3$"),
        (f"f 1 2 -{'9' * 99}\n", r"line 4: vertex -\d+ does not exist$"),
        ("f 1 2 3.0\n", r"line 4: `3\.0` is no corner of a face \(v, v/vt, v//vn or v/vt/vn\)$"),
        ("f 1 2 1_0\n", r"line 4: `1_0` is no corner"),
        ("f 1 2 3/1/1/1\n", r"line 4: `3/1/1/1` is no corner"),
        ("f 1 2 /3\n", r"line 4: `/3` is no corner"),
        (f"f 1 2 {'x' * 9999}\n", r"line 4: `x{60}…` is no corner"),
        (f"f 1 2 {'9' * 9999}\n", r"line 4: `9{60}…` is no corner"),
        ("f 1 2\n", r"line 4: has fewer than three corners$"),
        ("f 1 2 \\", r"line 4: has fewer than three corners$"),
        ("vn 0 1\n", r"line 4: `vn` needs three numbers$"),
        ("v 1_0 0 0\n", r"line 4: `v 1_0 0 0` is not three numbers$"),
        ("v 0 inf 0\nf 1 2 3\n", r"line 4: a vertex is not finite or leaves the range of single precision$"),
        ("v 0 0 -3.5e38\nf 1 2 3\n", r"line 4: a vertex is not finite or leaves the range"),
        ("v 0 0 1e999\nf 1 2 3\n", r"line 4: a vertex is not finite or leaves the range"),
        ("vn 0 nan 0\nf 1 2 3\n", r"line 4: a normal is not finite$"),
    ],
)
def test_the_sentence_names_file_and_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(SceneError, match=r"a\.obj, " + message) as caught:
        read_obj(write(tmp_path, THREE + text))
    assert len(str(caught.value).partition("a.obj")[2]) < 150


def test_a_missing_file_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"none\.obj: cannot be read \(No such file"):
        read_obj(tmp_path / "none.obj")


def test_normals_of_the_file_may_have_any_length(tmp_path: Path) -> None:
    """Huge and tiny ones become unit length, also under a scale; zero stays zero (the kernel replaces it)."""
    normals = "vn 1e300 1e300 0\nvn 0 0 -1e-310\nvn 0 0 0\n"
    mesh = Mesh(file="a.obj", scale=(1e-9, 1e-9, 1e-9))
    data = read_mesh(mesh, write(tmp_path, THREE + normals + "f 1//1 2//2 3//3\n"), "m")
    found = place_mesh(data, mesh.placement).corner_normals[0]
    np.testing.assert_allclose(found, [[0.5**0.5, 0.5**0.5, 0], [0, 0, -1], [0, 0, 0]], rtol=1e-15)


def random_obj(rng: np.random.Generator, every_corner: bool) -> str:
    """Vertices, normals and polygons of 3 to 7 corners, mixed, in every way to name a corner."""
    lines, vertices, normals = [], 0, 0
    for _ in range(60):
        for _ in range(rng.integers(1, 4) if vertices else 7):
            lines.append("v " + " ".join(map(repr, rng.normal(size=3).tolist())))
            vertices += 1
        lines.append("vn " + " ".join(map(repr, rng.normal(size=3).tolist())))
        normals += 1
        corners = []
        for _ in range(rng.integers(3, 8)):
            v = int(rng.integers(1, vertices + 1)) - rng.choice([0, vertices + 1])
            n = int(rng.integers(1, normals + 1)) - rng.choice([0, normals + 1])
            form = rng.choice(["{v}//{n}", "{v}/1/{n}"] if every_corner else ["{v}", "{v}/1", "{v}//{n}"])
            corners.append(form.format(v=v, n=n))
        lines.append("f " + " ".join(corners))
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("every_corner", [True, False])
@pytest.mark.parametrize("seed", range(5))
def test_the_plain_reader_finds_the_same(tmp_path: Path, seed: int, every_corner: bool) -> None:
    path = write(tmp_path, random_obj(np.random.default_rng(seed), every_corner))
    data, plain = read_mesh(Mesh(file="a.obj"), path, "m"), plain_files.read_mesh(path)
    assert data.triangles.tolist() == [list(t) for t in plain.triangles]
    assert np.array_equal(data.vertices, np.array(plain.vertices, np.float32))
    assert (plain.corner_normals is not None) == every_corner
    assert np.array_equal(data.normals, np.array(plain.corner_normals or np.zeros((0, 3, 3))))
