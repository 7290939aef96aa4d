"""Damaged mesh files of every format: cut short, changed at random, and with lies in their headers.

Whatever stands in a file, it is read or refused with one sentence, soon and without much memory.
"""

from __future__ import annotations

import json
import struct
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.unit.mesh_writers import Gltf, stl_ascii, stl_binary
from tests.unit.ugly_meshes import SQUARE, UGLY
from tracer.errors import SceneError
from tracer.shapes import Mesh
from tracer.shapes.cutting import LARGEST_CONCAVE
from tracer.shapes.triangles import MeshData, read_mesh

LONGEST = 2.0  # seconds of processor time for one file
LARGEST = 2_000_000  # bytes for one small file
FACETS = [SQUARE[:3], [SQUARE[0], SQUARE[2], SQUARE[3]]]


def content_of(name: str) -> bytes:
    content = UGLY[name].content
    return content if isinstance(content, bytes) else content.encode()


def attempt(path: Path, content: bytes) -> MeshData | str:
    """What is read, or the sentence."""
    path.write_bytes(content)
    started = time.process_time()
    try:
        found: MeshData | str = read_mesh(Mesh(file=path.name), path, "m")
    except SceneError as error:
        found = str(error)
        assert path.name in found and "\n" not in found and len(found) < len(str(path)) + 300
    assert time.process_time() - started < LONGEST
    return found


@pytest.mark.parametrize("name", UGLY)
def test_changed_at_random(tmp_path: Path, name: str) -> None:
    """Bytes replaced, taken out, repeated; numbers in all sorts of places become very large or negative."""
    whole, rng = content_of(name), np.random.default_rng(sum(name.encode()))
    for _ in range(60):
        data = bytearray(whole)
        for _ in range(rng.integers(1, 5)):
            at, length = int(rng.integers(0, len(data))), int(rng.integers(1, 9))
            new = [bytes(rng.integers(0, 256, length).tolist()), b"", bytes(data[at : at + 40]) * 3]
            new += [b"9" * 20, b"-1", b"\xff\xff\xff\x7f", b"nan", b"1e999", b"[", b"{}", b"null"]
            data[at : at + length] = new[rng.integers(0, len(new))]
        found = attempt(tmp_path / name, bytes(data))
        if not isinstance(found, str):
            assert np.isfinite(found.vertices).all()
            assert 0 <= found.triangles.min() <= found.triangles.max() < len(found.vertices)


@pytest.mark.parametrize("name", [name for name in UGLY if not name.endswith(".obj")])
def test_cut_anywhere_it_is_refused(tmp_path: Path, name: str) -> None:
    """All formats but OBJ say how much there is."""
    whole = content_of(name).rstrip() if name.startswith(("ascii", "crlf")) else content_of(name)
    ends = {".stl": whole.lower().rfind(b"endsolid") + 8, ".ply": whole.rfind(b" ") + 1}
    text = name.split(".")[0] in ("ascii", "crlf", "upper", "one_line")
    last = ends[Path(name).suffix] if text else len(whole)
    first_solid = whole.find(b"endsolid") + 8
    for end in [*range(0, last, max(1, last // 150)), last - 1]:
        if name == "two.stl" and first_solid <= end <= whole.find(b"solid ", first_solid):
            continue  # the first of two solids is whole
        if name == "two.stl" and end >= whole.rfind(b"endsolid") + 8:
            continue
        assert isinstance(attempt(tmp_path / name, whole[:end]), str)


@pytest.mark.parametrize("name", [name for name in UGLY if name.endswith(".obj")])
def test_an_obj_file_cut_anywhere_is_read_or_refused(tmp_path: Path, name: str) -> None:
    whole = content_of(name)
    for end in range(len(whole)):
        attempt(tmp_path / name, whole[:end])


def changed(change: Callable[[dict[str, Any]], Any]) -> bytes:
    """A square as .gltf after a change of its JSON."""
    file = Gltf()
    file.mesh(file.primitive(SQUARE, [0, 1, 2, 0, 2, 3]), name="n")
    file.tree |= {"scenes": [{"nodes": [0]}]}
    tree = json.loads(file.json())
    change(tree)
    return json.dumps(tree).encode()


GLTF: list[tuple[Callable[[dict[str, Any]], Any], str]] = [
    (lambda t: t.pop("asset"), "`asset` of the file is nothing; allowed: a table"),
    (lambda t: t["asset"].update(version="1.0"), '`asset.version` is "1.0"; allowed: 2.0'),
    (lambda t: t.update(extensionsRequired=["KHR_draco_mesh_compression"]), 'it requires "KHR_draco'),
    (lambda t: t.update(scene=3), "`scene` is 3; the file has 1 `scenes`"),
    (lambda t: t["scenes"][0].update(nodes=[0, 0]), "node 0 stands in two places of the tree"),
    (lambda t: t["nodes"][0].update(children=[0]), "node 0 stands in two places of the tree"),
    (lambda t: t["nodes"][0].update(children=[-1]), "`nodes.0.children` is -1; the file has 1 `nodes`"),
    (lambda t: t["nodes"][0].update(mesh="a"), '`nodes.0.mesh` is "a"; the file has 1 `meshes`'),
    (lambda t: t["nodes"][0].update(skin=0), "`nodes.0` has a skin or weights"),
    (lambda t: t["nodes"][0].update(matrix=[1] * 15), "`matrix` of `nodes.0` is a list of 15; allowed: 16"),
    (lambda t: t["nodes"][0].update(scale=[1e300, 1, 1]), "`nodes.0`, counted from 0, is not finite"),
    (lambda t: t["nodes"][0].update(scale=[1, 1, 10**400]), "`scale` of `nodes.0`"),
    (lambda t: t["nodes"][0].update(rotation=[0, 0, 0, 0]), "`rotation` of `nodes.0` has no length"),
    (lambda t: t["meshes"][0]["primitives"][0].update(mode=7), "`mode` of `meshes.0.primitives.0` is 7"),
    (lambda t: t["meshes"][0]["primitives"][0].pop("attributes"), "`attributes` of `meshes.0.primitives.0`"),
    (lambda t: t["meshes"][0]["primitives"][0].pop("indices"), "has 4 corners; allowed: a multiple of three"),
    (
        lambda t: t["meshes"][0]["primitives"][0]["attributes"].update(NORMAL=9),
        "`NORMAL` of .* is 9; the file",
    ),
    (lambda t: t["accessors"][0].update(count=5), "`accessors.0` needs 6. bytes; `bufferViews.0` has 48"),
    (lambda t: t["accessors"][0].update(count=2**31), "`accessors.0` needs \\d+ bytes"),
    (lambda t: t["accessors"][0].update(count=3), "names vertex 3, counted from 0; it has 3"),
    (lambda t: t["accessors"][0].update(count=-1), "`count` of `accessors.0` is -1"),
    (
        lambda t: t["accessors"][0].update(type="VEC2"),
        '`accessors.0` has the type "VEC2"; allowed here: VEC3',
    ),
    (
        lambda t: t["accessors"][0].update(componentType=1),
        "`componentType` of `accessors.0` is 1; allowed: 5120",
    ),
    (lambda t: t["accessors"][0].pop("bufferView"), "`accessors.0` has no `bufferView`"),
    (lambda t: t["accessors"][1].update(componentType=5120), "`indices` of .* are no whole numbers from 0"),
    (lambda t: t["bufferViews"][0].update(byteLength=2**31), "`bufferViews.0` ends at byte 2147483648"),
    (lambda t: t["bufferViews"][0].update(byteStride=8), "a `byteStride` of 8; allowed: 12 at least"),
    (
        lambda t: t["buffers"][0].update(byteLength=2**31),
        "`buffers.0` has 54 bytes; 2147483648 are announced",
    ),
    (
        lambda t: t["buffers"][0].update(uri="../a.bin"),
        'is "../a.bin"; allowed: a file in the folder of this',
    ),
    (lambda t: t["buffers"][0].update(uri="/a.bin"), 'is "/a.bin"; allowed: a file in the folder of this'),
    (lambda t: t["buffers"][0].update(uri="http://a/b"), 'is "http://a/b"; allowed: a file in the folder'),
    (lambda t: t["buffers"][0].update(uri="a.bin"), 'is "a.bin", which cannot be read \\(No such file'),
    (lambda t: t["buffers"][0].update(uri="data:;base64,a"), "is no base64"),
    (lambda t: t["buffers"][0].pop("uri"), "`buffers.0` has no `uri`"),
    (lambda t: t.update(nodes=[]), "the nodes of the scene is 0; the file has 0 `nodes`"),
]


@pytest.mark.parametrize(("change", "message"), GLTF)
def test_a_gltf_that_lies(tmp_path: Path, change: Callable[[dict[str, Any]], Any], message: str) -> None:
    check(tmp_path / "a.gltf", changed(change), rf"a\.gltf: is damaged or no glTF file \(.*{message}")


def check(path: Path, content: bytes, message: str) -> None:
    """Refused with the sentence, and with little memory."""
    tracemalloc.start()
    try:
        found = attempt(path, content)
        assert tracemalloc.get_traced_memory()[1] < LARGEST + 4 * len(content)
    finally:
        tracemalloc.stop()
    with pytest.raises(SceneError, match=message):
        raise SceneError(found)


GLB = UGLY["plain.glb"].content
assert isinstance(GLB, bytes)
FLOOD = {"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}] * 3000, "meshes": [{"primitives": [{}] * 3000}]}


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.stl", b"", r"is damaged or no STL file \(it has 0 bytes"),
        ("a.stl", stl_binary(FACETS, count=2**31), r"its header says 2147483648 facets, .* 100 follow\)$"),
        ("a.stl", stl_binary(FACETS) + b"\0", r"its header says 2 facets, which take 100 bytes; 101 follow"),
        ("a.stl", stl_binary([]), "has no faces; allowed: a mesh with one triangle at least"),
        ("a.stl", b"solid\nendsolid\n", "has no faces; allowed: a mesh with one triangle at least"),
        (
            "a.stl",
            stl_binary([[[0, 0, 0], [0, np.nan, 0], [0, 0, 0]]]),
            "vertex 1 of facet 0, counted from 0, is not",
        ),
        (
            "a.stl",
            stl_ascii([[[0, 0, 0], [0, 1e39, 0], [0, 0, 0]]]).encode(),
            "line 5: a vertex is not finite",
        ),
        (
            "a.stl",
            b"solid\nfacet normal 0 0 1\nvertex 0 0 0\n",
            "line 3: `vertex 0 0 0` stands where `outer loop`",
        ),
        (
            "a.stl",
            b"solid\nfacet normal 0 0 1 outer loop\nvertex 0 x 0\n",
            "line 3: `vertex 0 x 0` is not three",
        ),
        (
            "a.stl",
            stl_ascii(FACETS).replace(" endloop", "vertex 1 1 1", 1).encode(),
            "line 7: .* where `endloop`",
        ),
        ("a.stl", b"solid a\nsolid b\n", "line 2: `solid` stands where `facet normal x y z` or `endsolid`"),
        ("a.stl", b"solid a\nfacet normal 0 0 1\n", "line 3: the file ends where `outer loop` is allowed"),
        ("a.glb", b"", r"line 1 of its JSON: Expecting value"),
        ("a.gltf", b"[]", r"its JSON is no table"),
        ("a.gltf", b"[" * 100_000, r"its JSON is no glTF"),
        ("a.gltf", b'{"a": ' + b"9" * 5000 + b"}", r"its JSON is no glTF"),
        ("a.gltf", b"\xff\xfe\0", r"it is no UTF-8 text and no GLB container"),
        (
            "a.glb",
            GLB[:8] + struct.pack("<I", 2**31) + GLB[12:],
            r"its header says 2147483648 bytes; the file has",
        ),
        (
            "a.glb",
            GLB[:12] + struct.pack("<I", 2**31) + GLB[16:],
            r"its first chunk is no JSON, or longer than",
        ),
        ("a.glb", GLB[:4] + struct.pack("<I", 1) + GLB[8:], r"its container has version 1; allowed: 2"),
        ("a.gltf", json.dumps(FLOOD).encode(), "`attributes` of `meshes.0.primitives.0` is nothing"),
        (
            "a.gltf",
            json.dumps({"asset": {"version": "2.0"}}).encode(),
            "has no faces; allowed: a mesh with one",
        ),
    ],
)
def test_one_sentence(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    check(tmp_path / name, content, message)


def test_a_mesh_that_too_many_nodes_repeat(tmp_path: Path) -> None:
    """A file of 200 kB that stands for 70 million triangles."""
    file = Gltf()
    primitive = file.primitive(SQUARE, [0, 1, 2, 0, 2, 3] * 3000)
    file.mesh(primitive)
    file.tree["nodes"] *= 12_000
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tracer.shapes.gltf.MOST_TRIANGLES", 500_000)  # it would take some seconds
        found = attempt(tmp_path / "a.gltf", file.json())
    assert isinstance(found, str) and "it has too many triangles; allowed: 500000" in found


def test_a_polygon_of_too_many_corners(tmp_path: Path) -> None:
    """A convex one may have any number; one that crosses itself everywhere is soon done with, too."""
    count = LARGEST_CONCAVE + 2
    angles = np.linspace(0, 2 * np.pi, count, endpoint=False)
    for radius, expected in ((1.0, None), (1 - 0.3 * (np.arange(count) % 2), "allowed: 20000 corners")):
        points = np.stack([radius * np.cos(angles), radius * np.sin(angles), 0 * angles], axis=1) * 1e6
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
        content = "\n".join([*lines, "f " + " ".join(map(str, range(1, count + 1)))]).encode()
        found = attempt(tmp_path / "a.obj", content)
        if expected is None:
            assert isinstance(found, MeshData) and len(found.triangles) == count - 2
        else:
            assert isinstance(found, str) and "a.obj: face 0 has 20002 corners and is not convex" in found
    tangle = "\n".join([f"v {x} {y} 0" for x, y in np.random.default_rng(1).normal(size=(3000, 2)).tolist()])
    found = attempt(tmp_path / "a.obj", (tangle + "\nf " + " ".join(map(str, range(1, 3001)))).encode())
    assert isinstance(found, MeshData) and len(found.triangles) == 2998
