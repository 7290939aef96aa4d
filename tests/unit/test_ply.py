"""PLY files: a random soup in many layouts, unusual headers, and broken files with their sentences."""

from __future__ import annotations

import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from reference import plain_files
from tests.unit.mesh_writers import faces_of
from tracer.errors import SceneError
from tracer.shapes import Mesh
from tracer.shapes.ply import read_ply
from tracer.shapes.triangles import read_mesh

FORMS = ("ascii", "binary_little_endian", "binary_big_endian")
OLD = "char uchar short ushort int uint float double".split()
NEW = "int8 uint8 int16 uint16 int32 uint32 float32 float64".split()
CODES = dict(zip(OLD + NEW, 2 * "bBhHiIfd", strict=True))
XYZ = "property float x\nproperty float y\nproperty float z\n"
FACES = "element face 1\nproperty list uchar int vertex_indices\n"
CORNERS = "0 0 0\n1 0 0\n0 1 0\n"
BINARY_CORNERS = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)


def write(folder: Path, data: str | bytes) -> Path:
    path = folder / "a.ply"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return path


def ascii_ply(body: str, properties: str = XYZ, faces: str = FACES) -> str:
    """Three vertices and one face, unless the header says otherwise."""
    return f"ply\nformat ascii 1.0\nelement vertex 3\n{properties}{faces}end_header\n{body}"


def packed(form: str, kinds: list[str], values: list[float]) -> bytes:
    if form == "ascii":
        return (" ".join(map(repr, values)) + "\n").encode()
    order = "<" if form == "binary_little_endian" else ">"
    return struct.pack(order + "".join(CODES[kind] for kind in kinds), *values)


class Soup:
    """30 single precision points with normals and 40 polygons of 3 to 9 corners."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.vertices = self.rng.normal(size=(30, 3)).astype(np.float32).astype(float)
        self.normals = self.rng.normal(size=(30, 3)).astype(np.float32).astype(float)
        self.faces = [self.rng.integers(0, 30, self.rng.integers(3, 10)).tolist() for _ in range(40)]

    def file(self, form: str, with_normals: bool) -> bytes:
        """Properties in random order, of random types, among others; elements before, between and after."""
        rng = self.rng
        columns = {name: self.vertices[:, k] for k, name in enumerate("xyz")}
        columns |= {"red": rng.integers(0, 100, 30), "quality": rng.integers(-9, 9, 30)}
        if with_normals:
            columns |= {name: self.normals[:, k] for k, name in enumerate(("nx", "ny", "nz"))}
        names = rng.permutation(list(columns)).tolist()
        reals, whole = ["float", "double", "float32", "float64"], ["char", "short", "int16", "int", "double"]
        kinds = [str(rng.choice(whole if name in ("red", "quality") else reals)) for name in names]
        length, index = (
            rng.choice(["uchar", "int8", "ushort", "int32"]),
            rng.choice(["uchar", "int", "uint32"]),
        )
        key = rng.choice(["vertex_indices", "vertex_index"])
        header = f"ply\nformat {form} 1.0\ncomment end_header comes later\nobj_info element vertex 7\n"
        header += (
            "element camera 2\nproperty short view\nproperty list char double weights\nelement vertex 30\n"
        )
        header += "".join(f"property {kind} {name}\n" for kind, name in zip(kinds, names, strict=True))
        header += "element tag 1\nproperty uchar t\nelement face 40\nproperty list uchar float uv\n"
        header += f"property list {length} {index} {key}\nproperty double area\n"
        header += "element edge 1\nproperty int vertex1\nend_header\n"
        body = packed(form, ["short", "char"], [3, 0])
        body += packed(form, ["short", "char", "double", "double"], [4, 2, 1.5, -2.5])
        for k in range(30):
            row = [
                float(columns[name][k]) if kinds[i] in reals else int(columns[name][k])
                for i, name in enumerate(names)
            ]
            body += packed(form, kinds, row)
        body += packed(form, ["uchar"], [200])
        for k, face in enumerate(self.faces):
            uv = [0.25] * (k % 3)
            kinds_here = ["uchar", *["float"] * len(uv), length, *[index] * len(face), "double"]
            body += packed(form, kinds_here, [len(uv), *uv, len(face), *face, 0.5])
        return header.encode() + body + packed(form, ["int"], [9])


@pytest.mark.parametrize("with_normals", [True, False])
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("seed", range(4))
def test_every_layout_comes_back(tmp_path: Path, seed: int, form: str, with_normals: bool) -> None:
    """What was written is read; by the plain reader, too, without the comment that has `end_header` in it."""
    soup = Soup(seed)
    content = soup.file(form, with_normals)
    found = read_ply(write(tmp_path, content))
    assert np.array_equal(found.vertices, soup.vertices)
    assert faces_of(found) == soup.faces
    assert found.has_all_normals == with_normals
    assert np.array_equal(found.normals, soup.normals if with_normals else np.zeros((0, 3)))
    path = write(tmp_path, content.replace(b"comment end_header comes later\n", b""))
    data, plain = read_mesh(Mesh(file="a.ply"), path, "m"), plain_files.read_mesh(path)
    assert data.triangles.tolist() == [list(t) for t in plain.triangles]
    assert np.array_equal(data.normals, np.array(plain.corner_normals or np.zeros((0, 3, 3))))


@pytest.mark.parametrize("newline", [b"\n", b"\r\n", b"\r"])
@pytest.mark.parametrize("form", FORMS)
def test_line_ends_of_any_system(tmp_path: Path, form: str, newline: bytes) -> None:
    """Also where the first byte after the header looks like a line end (bytes 0a, 0d)."""
    header = ascii_ply("").replace("ascii", form).encode().replace(b"\n", newline)
    order = ">" if form == "binary_big_endian" else "<"
    x = struct.unpack(order + "f", b"\x0a\x0d\x0d\x0a")[0]
    body = f"{x!r} 0 0 1 0 0 0 1 0 3 0 1 2".encode()
    if form != "ascii":
        body = struct.pack(f"{order}9fB3i", x, 0, 0, 1, 0, 0, 0, 1, 0, 3, 0, 1, 2)
    soup = read_ply(write(tmp_path, header + body))
    assert soup.vertices[0, 0] == x and faces_of(soup) == [[0, 1, 2]]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("plywood\n" + ascii_ply(CORNERS + "3 0 1 2")[4:], r"\(it has no PLY header\)$"),
        (ascii_ply("").replace("end_header", "end"), r"\(it has no PLY header\)$"),
        ("ply\nend_header\n", r"\(its format is missing\)$"),
        ("ply\nformat\nend_header\n", r"\(line 2 of its header is `format`\)$"),
        (
            "ply\nformat ascii 1.0\nproperty int x\nend_header\n",
            r"\(line 3 of its header is `property int x`\)",
        ),
        (
            "ply\nformat ascii 1.0\nelement vertex -3\nend_header\n",
            r"line 3 of its header is `element vertex -3`",
        ),
        (
            "ply\nformat ascii 1.0\nelement vertex x\nend_header\n",
            r"line 3 of its header is `element vertex x`",
        ),
        (ascii_ply("", faces="element vertex 1\n"), r"line 7 of its header is `element vertex 1`"),
        (ascii_ply("", properties="property real x\n"), r"line 4 of its header is `property real x`"),
        (ascii_ply("", properties="property list int x\n"), r"line 4 of its header is `property list int x`"),
        (ascii_ply("", properties="property int x\n" * 2), r"line 5 of its header is `property int x`"),
        (
            ascii_ply(CORNERS + "3 0 1 2", properties=XYZ.replace(" x", " a")),
            r"\(its vertices have no number `x`\)",
        ),
        (
            ascii_ply("0 0 0 0 0 0 0 0 0 3 0 1 2", properties=XYZ.replace("float z", "list uchar float z")),
            r"\(its vertices have no number `z`\)$",
        ),
        (ascii_ply(CORNERS), r"\(it ends before its 1 entries of `face`\)$"),
        (ascii_ply(CORNERS + "3 0 1"), r"\(it ends too early\)$"),
        (ascii_ply(CORNERS + "1e300 0 1"), r"\(it ends too early\)$"),
        (ascii_ply(CORNERS + "-3 0 1 2"), r"\(a list has the length -3\.0\)$"),
        (ascii_ply(CORNERS + "nan 0 1 2"), r"\(a list has the length nan\)$"),
        (ascii_ply(CORNERS + "3.5 0 1 2"), r"\(a list has the length 3\.5\)$"),
        (ascii_ply(CORNERS + "3 0 1 x"), r"\('x' is not a number\)$"),
        (ascii_ply(CORNERS + "2 0 1"), r"\(face 0 has fewer than three corners\)$"),
        (ascii_ply(CORNERS + "3 0 1 1.5"), r"\(a face names a vertex that is no whole number\)$"),
        (ascii_ply(CORNERS + "3 0 1 nan"), r"\(a face names a vertex that is no whole number\)$"),
        (ascii_ply(CORNERS + "3 0 1 3"), r"a\.ply: face 0 names vertex 3, counted from 0; the file has 3$"),
        (ascii_ply(CORNERS + "3 0 1 -1"), r"a\.ply: face 0 names vertex -1, counted from 0; the file has 3$"),
        (
            ascii_ply(CORNERS + "3 0 1 1e30"),
            r"a\.ply: face 0 names vertex \d+, counted from 0; the file has 3$",
        ),
        (ascii_ply("0 0 0\n0 inf 0\n0 0 0\n3 0 1 2"), r"\(vertex 1, counted from 0, is not finite or leaves"),
        (
            ascii_ply("0 0 0\n0 0 0\n4e38 0 0\n3 0 1 2"),
            r"\(vertex 2, counted from 0, is not finite or leaves",
        ),
        (
            ascii_ply(
                "0 0 0 0 0 1\n" * 2 + "0 0 0 nan 0 1\n3 0 1 2",
                properties=XYZ + XYZ.replace("float ", "float n"),
            ),
            r"\(the normal of vertex 2, counted from 0, is not finite\)$",
        ),
    ],
)
def test_a_broken_file_is_one_sentence(tmp_path: Path, content: str, message: str) -> None:
    path = write(tmp_path, content)
    with pytest.raises(SceneError, match=message) as caught:
        read_ply(path)
    assert str(caught.value).startswith(f"{path}: ") and str(caught.value).count("a.ply") == 1


@pytest.mark.parametrize(
    "faces", ["", "element face 1\nproperty list uchar int strip\n", FACES.replace("1", "0")]
)
def test_a_file_without_faces_says_so(tmp_path: Path, faces: str) -> None:
    path = write(tmp_path, ascii_ply(CORNERS + "3 0 1 2\n", faces=faces))
    with pytest.raises(
        SceneError, match=r"m\.file: .*a\.ply has no faces; allowed: a mesh with one triangle"
    ):
        read_mesh(Mesh(file="a.ply"), path, "m")


@pytest.mark.parametrize(
    ("element", "body"),
    [
        ("element vertex 2147483648\n" + XYZ, BINARY_CORNERS),
        ("element vertex 99999999999999999999\n" + XYZ, BINARY_CORNERS),
        ("element vertex 3\n" + XYZ + FACES.replace("1", "2147483648"), BINARY_CORNERS + b"\3"),
        ("element vertex 3\n" + XYZ + FACES.replace("uchar", "uint"), BINARY_CORNERS + b"\xff\xff\xff\xff"),
        (
            "element vertex 3\n" + XYZ + FACES.replace("uchar", "double"),
            BINARY_CORNERS + struct.pack("<d", 1e300),
        ),
        ("element none 2147483648\nelement vertex 4\n" + XYZ, BINARY_CORNERS),
    ],
)
def test_counts_that_lie_take_no_memory(tmp_path: Path, element: str, body: bytes) -> None:
    path = write(tmp_path, f"ply\nformat binary_little_endian 1.0\n{element}end_header\n".encode() + body)
    tracemalloc.start()
    with pytest.raises(SceneError, match="it ends (before its|too early)"):
        read_ply(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1_000_000


@pytest.mark.parametrize("form", FORMS)
def test_cut_at_any_byte_a_file_is_refused(tmp_path: Path, form: str) -> None:
    """From the first byte of the header to the last of the body: an error, and nothing but a `SceneError`."""
    body = (CORNERS + "3 0 1 2").encode()
    if form != "ascii":
        order = "<" if form == "binary_little_endian" else ">"
        body = struct.pack(f"{order}9fB3i", 0, 0, 0, 1, 0, 0, 0, 1, 0, 3, 0, 1, 2)
    whole = ascii_ply("").replace("ascii", form).encode() + body
    assert faces_of(read_ply(write(tmp_path, whole))) == [[0, 1, 2]]
    for end in range(len(whole)):
        with pytest.raises(SceneError, match=r"a\.ply: is damaged or no PLY file"):
            read_ply(write(tmp_path, whole[:end]))
