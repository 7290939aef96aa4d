"""Odd but legal OBJ files with what they hold, and broken ones with the sentence that names the line."""

from __future__ import annotations

import tracemalloc
import warnings
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from reference import plain_files
from tests.unit.mesh_writers import faces_of
from tracer.errors import SceneError
from tracer.shapes import Mesh, obj
from tracer.shapes.obj import read_obj
from tracer.shapes.obj_blocks import read_block
from tracer.shapes.obj_statements import Statements, WrongLine, read_statements
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
    assert faces_of(soup) == [[0, 1, 2]]
    assert not soup.has_all_normals


def test_numbers_count_back_from_the_face_and_not_from_the_end(tmp_path: Path) -> None:
    """Vertices and normals count each for themselves; both numbers of a corner may be negative."""
    text = THREE + "vn 0 0 1\nf -3//-1 -2//-1 -1//-1\nv 5 5 5\nvn 0 1 0\nvn 1 0 0\nf -1//-2 -2/9/3 1//1\n"
    soup = read_obj(write(tmp_path, text))
    assert faces_of(soup) == [[0, 1, 2], [3, 2, 0]]
    assert soup.corner_normals.tolist() == [0, 0, 0, 1, 2, 0]
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


# ---- Blocks ------------------------------------------------------------------------------------------------

WHOLE_LINES = [
    *("v 1 2 3\n", "v 1.5 -2.25 3e2 \n", "v .1 2. 3E-3 1 1 1\n", "vn\t0 0 1\n", "vt 0 0\n", "vp 1\n", "\n"),
    *(
        "f 1 2 3\n",
        "f 1/2/3 2/2/2 3/3/3\n",
        "f 1//1 2//1 3//1 4//1\n",
        "f -1 -2 -3\n",
        "f 1 2/3 4//5 6/7/8\n",
    ),
    *("# f 1\n", "o v 1\n", "g\n", "s off\n", "usemtl f\n"),
]
CORNERS = ["1", "2", "-1", "1/2", "1//2", "1/2/3", "-1/-2/-3", "2147483646"]
NUMBERS = ["1", "-1", "+1", "0.5", "1e5", "1.E-5", ".5", "-0.0", "1e-400", "1e999", "7" * 30]
ODD = [
    *(
        "1.2.3",
        "1e",
        "e5",
        ".",
        "-",
        "--1",
        "1-2",
        "1+2",
        "1e5.5",
        "1.e5e",
        "1_0",
        "nan",
        "inf",
        "0x1",
        "1f",
        "x",
    ),
    *(
        "1/",
        "1//",
        "/1",
        "/",
        "//",
        "1/x/2",
        "1///2",
        "1/2/3/4",
        "0",
        "0//1",
        "1//0",
        "1/0/2",
        "1/-/2",
        "1/2-3",
    ),
    *(
        "2147483648",
        "-2147483648",
        "9" * 25,
        "#",
        "# 1",
        "\\",
        "\\\n",
        "\n",
        "\x0b",
        "\x0c",
        "\xa0",
        "\u2028",
    ),
    *("\0", "\x1c", "\x85", "\u0663", "v", "f"),
]
KEYWORDS = [
    "v",
    "vn",
    "vt",
    "f",
    "v#",
    "vn#",
    "f#",
    "vnx",
    "vx",
    "fx",
    "#",
    " v",
    "\tf",
    "\x0cf",
    "\xe9",
    "\\",
    "",
]


def random_line(rng: np.random.Generator) -> str:
    """A line that is as it should be, or has one or two odd words."""
    if rng.random() < 0.3:
        return str(rng.choice(WHOLE_LINES))
    keyword = str(rng.choice(KEYWORDS if rng.random() < 0.1 else KEYWORDS[:4]))
    words = rng.choice(CORNERS if "f" in keyword else NUMBERS, rng.integers(2, 6)).tolist()
    for _ in range(rng.integers(0, 3) if rng.random() < 0.3 else 0):
        words[rng.integers(len(words))] = str(rng.choice(ODD))
    return f"{keyword}{rng.choice([' ', '  ', chr(9)])}{' '.join(words)}{rng.choice(['', ' '])}\n"


def same_statements(found: Statements, expected: Statements) -> bool:
    """To the last bit."""
    pairs = [(getattr(found, field.name), getattr(expected, field.name)) for field in fields(Statements)]
    return all(a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes() for a, b in pairs)


@pytest.mark.parametrize("seed", range(3))
def test_a_block_says_what_its_lines_say(seed: int) -> None:
    """Or it is left to be read line by line, as it must where a line is wrong."""
    rng, taken = np.random.default_rng(seed), 0
    for _ in range(1500):
        block = "".join(random_line(rng) for _ in range(rng.integers(1, 6))).encode()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # as users have it
            found = read_block(block, 7)
        try:
            expected = read_statements(block.decode(), 7)
        except WrongLine:
            assert found is None, block
            continue
        assert found is None or same_statements(found, expected), block
        taken += found is not None
    assert taken > 250


@pytest.mark.parametrize(
    "block",
    [
        "v 1.2.3 1 2\nv 1 2 .\n",
        "v 1-2 1 2\nv 1 2 e5\n",
        "v 1e5.5 1 2\nv 1 2 -\n",
        "f 1-2 2 3\nf 1 2 -\n",
        "f 1/2-3 2/1 3/1\nf 1/1 2/1 3/\n",
    ],
)
def test_two_mistakes_that_make_up_for_each_other(block: str) -> None:
    """One word with two numbers, another with none."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        assert read_block(block.encode(), 1) is None


def test_ordinary_lines_are_read_in_blocks() -> None:
    """Each by itself, and all of them in turn."""
    for block in (*WHOLE_LINES, "".join(WHOLE_LINES) * 3, "v 1 2 3", "f 1 2 3\nf 1 2 3 4"):
        found = read_block(block.encode(), 1)
        assert found is not None and same_statements(found, read_statements(block, 1)), block


@pytest.mark.parametrize("form", ["%r", "%.17g", "%.25e", "%.9g", "%.3f", "%E"])
def test_numbers_in_blocks_are_rounded_correctly(form: str) -> None:
    rng = np.random.default_rng(5)
    numbers = (rng.normal(size=(500, 3)) * 10.0 ** rng.integers(-60, 38, (500, 3))).tolist()
    text = "".join("v " + " ".join(form % x for x in row) + "\n" for row in numbers)
    found = read_block(text.encode(), 1)
    assert found is not None
    assert found.vertices.tolist() == [[float(form % x) for x in row] for row in numbers]


@pytest.mark.parametrize("block", [1, 30, 200])
def test_where_blocks_end_makes_no_difference(
    block: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Lines that go on, negative numbers and the line of an error, across many blocks."""
    text = random_obj(np.random.default_rng(1), every_corner=False).replace("\n", "\r\n")
    text = text.replace(" -", " \\\r\n -").replace("vn", "usemtl a\\b\r\nvn")
    whole = read_obj(write(tmp_path, text))
    monkeypatch.setattr(obj, "BLOCK", block)
    parts = read_obj(write(tmp_path, text))
    for name in ("vertices", "normals", "corners", "sizes", "corner_normals"):
        assert np.array_equal(getattr(parts, name), getattr(whole, name))
    wrong = text.count("\n") + 3
    for line, problem in (("f 1 2 x", "is no corner"), ("f 1 2 -999", "does not exist"), ("v 1", "needs")):
        with pytest.raises(SceneError, match=rf"line {wrong}: .*{problem}"):
            read_obj(write(tmp_path, text + "\r\n\r\n" + line))


def test_memory_stays_within_five_times_the_file(tmp_path: Path) -> None:
    count = 60_000
    numbers = np.random.default_rng(2).normal(size=(count, 3)).astype(np.float32).tolist()
    faces = np.random.default_rng(3).integers(1, count + 1, (2 * count, 3)).tolist()
    lines = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in numbers] + [f"f {a} {b} {c}" for a, b, c in faces]
    path = write(tmp_path, "\n".join(lines))
    tracemalloc.start()
    try:
        soup = read_obj(path)
        assert tracemalloc.get_traced_memory()[1] < 5 * path.stat().st_size
    finally:
        tracemalloc.stop()
    assert len(soup.sizes) == 2 * count


# ---- Two readers -------------------------------------------------------------------------------------------


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
