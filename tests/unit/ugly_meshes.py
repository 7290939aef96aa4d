"""The conformance set: small ugly mesh files, each with the vertices, triangles and faces that it holds."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

from tests.unit.mesh_writers import Gltf, stl_ascii, stl_binary

Points = list[list[float]]


@dataclass(frozen=True)
class Ugly:
    """A file and what a reader must find in it; `beside`: other files that it names."""

    file: str
    content: str | bytes
    vertices: Points
    triangles: list[list[int]]
    faces: list[int]
    with_normals: bool = False
    beside: dict[str, bytes] = field(default_factory=dict)


SQUARE: Points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
ARROW: Points = [[0, 0, 0], [4, 2, 0], [0, 4, 0], [1, 2, 0]]  # the last corner is reflex
NOTCH: Points = [
    [0, 0, 0],
    [2, 1, 0],
    [4, 0, 0],
    [4, 4, 0],
    [2, 4, 0],
    [0, 4, 0],
]  # reflex, and one on an edge


def obj(points: Points, *lines: str) -> str:
    """Vertices, then other lines."""
    return "\n".join([*(f"v {' '.join(map(repr, p))}" for p in points), *lines, ""])


def obj_files() -> Iterator[Ugly]:
    """OBJ: numbers, corners, polygons, lines."""
    fan = [[0, 1, 2], [0, 2, 3]]
    yield Ugly("negative.obj", obj(SQUARE, "f -4 -3 -2 -1"), SQUARE, fan, [0, 0])
    yield Ugly(
        "quad.obj", obj(SQUARE, "f 1 2 3 4", "f 4 3 2 1"), SQUARE, [*fan, [3, 2, 1], [3, 1, 0]], [0, 0, 1, 1]
    )
    corners = obj(SQUARE, "vt 0 0", "vn 0 0 1", "f 1 2/1 3//1", "f 1/1/1 -2//-1 4/")
    yield Ugly("corners.obj", corners, SQUARE, fan, [0, 1])
    whole = obj(SQUARE, "vn 0 0 1", "f 1//1 2//-1 3/7/1 4//1")
    yield Ugly("normals.obj", whole, SQUARE, fan, [0, 0], with_normals=True)
    yield Ugly("crlf.obj", obj(SQUARE, "f 1 2 \\", " 3 4").replace("\n", "\r\n"), SQUARE, fan, [0, 0])
    groups = obj(
        SQUARE[:3], "o one", "g a b", "usemtl x", "f 1 2 3", "v 0.0 1.0 0.0", "o two", "s off", "g", "f 1 3 4"
    )
    yield Ugly("groups.obj", groups, SQUARE, fan, [0, 1])
    unused = obj([[9, 9, 9], *SQUARE, [8, 8, 8]], "f 2 3 4", "f 2 4 5")
    yield Ugly("unused.obj", unused, [[9, 9, 9], *SQUARE, [8, 8, 8]], [[1, 2, 3], [1, 3, 4]], [0, 1])
    yield Ugly(
        "third.obj",
        obj([[1 / 3, 1e-60, 1e38], *SQUARE[1:]], "f 1 2 3"),
        [[1 / 3, 1e-60, 1e38], *SQUARE[1:]],
        fan[:1],
        [0],
    )
    yield Ugly("arrow.obj", obj(ARROW, "f 1 2 3 4"), ARROW, [[1, 2, 3], [1, 3, 0]], [0, 0])
    yield Ugly("backward.obj", obj(ARROW, "f 4 3 2 1"), ARROW, [[3, 2, 1], [3, 1, 0]], [0, 0])
    notch = [[1, 2, 3], [1, 3, 4], [1, 4, 5], [1, 5, 0]]
    yield Ugly("notch.obj", obj(NOTCH, "f 1 2 3 4 5 6"), NOTCH, notch, [0] * 4)
    straight: Points = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]]
    yield Ugly(
        "straight.obj", obj(straight, "f 1 2 3 4 5"), straight, [[1, 2, 3], [1, 3, 4], [1, 4, 0]], [0] * 3
    )
    twice = obj(SQUARE, "f 1 2 2 3 4")
    yield Ugly("twice.obj", twice, SQUARE, [[1, 2, 3], [1, 3, 0], [1, 0, 1]], [0] * 3)
    bent: Points = [[0, 0, 0], [1, 0, 1], [1, 1, 0], [0, 1, 1]]  # no plane holds it
    yield Ugly("bent.obj", obj(bent, "f 1 2 3 4"), bent, fan, [0, 0])
    again = obj(SQUARE, "f 1 2 3", "f 1 1 2", "f 3 2 1", "f 1 2 3")
    yield Ugly("again.obj", again, SQUARE, [[0, 1, 2], [0, 0, 1], [2, 1, 0], [0, 1, 2]], [0, 1, 2, 3])


def ply_files() -> Iterator[Ugly]:
    """PLY: the same polygons of mixed sizes in all three forms, in odd types."""
    polygons = [[0, 1, 2, 3], [0, 1, 2], [3, 2, 1, 0]]
    triangles = [[1, 2, 3], [1, 3, 0], [0, 1, 2], [3, 2, 1], [3, 1, 0]]
    for form, order in (("ascii", ""), ("binary_little_endian", "<"), ("binary_big_endian", ">")):
        head = f"ply\nformat {form} 1.0\ncomment x\nelement vertex 4\nproperty uchar red\nproperty double z\n"
        head += (
            "property float y\nproperty short x\nelement face 3\nproperty list uchar ushort vertex_indices\n"
        )
        rows = [("Bdfh", (255, z, y, int(x))) for x, y, z in ARROW]
        rows += [(f"B{len(p)}H", (len(p), *p)) for p in polygons]
        if order:
            body = b"".join(struct.pack(order + layout, *row) for layout, row in rows)
        else:
            body = "\n".join(" ".join(map(str, row)) for _, row in rows).encode()
        content = head.encode() + b"end_header\n" + body
        yield Ugly(f"{form}.ply", content, ARROW, triangles, [0, 0, 1, 2, 2])


def stl_files() -> Iterator[Ugly]:
    """STL: three vertices a facet, in order."""
    facets = [SQUARE[:3], [SQUARE[0], SQUARE[2], SQUARE[3]]]
    vertices, triangles = [c for facet in facets for c in facet], [[0, 1, 2], [3, 4, 5]]
    text = stl_ascii(facets, "vertex facet of solid")
    for name, content in (
        ("ascii", text),
        ("crlf", text.replace("\n", "\r\n")),
        ("upper", text.upper().replace("\n", "\r")),
        (
            "one_line",
            text.replace("facet of", "of")
            .replace("\n", " ")
            .replace(" facet normal", "\nfacet normal", 1)
            .replace(" endsolid", "\nendsolid"),
        ),
        ("two", stl_ascii(facets[:1]) + "\n\n" + stl_ascii(facets[1:], "")),
        ("binary", stl_binary(facets)),
        ("solid", stl_binary(facets, b"solid but binary")),
    ):
        yield Ugly(f"{name}.stl", content, vertices, triangles, [0, 1])


def gltf_files() -> Iterator[Ugly]:
    """glTF: containers, buffers, accessors, primitives, nodes."""
    fan = [[0, 1, 2], [0, 2, 3]]
    file = Gltf()
    file.mesh(file.primitive(SQUARE, [0, 1, 2, 0, 2, 3]))
    yield Ugly("plain.gltf", file.json(), SQUARE, fan, [0, 1])
    yield Ugly("plain.glb", file.glb(), SQUARE, fan, [0, 1])
    yield Ugly("beside.gltf", file.json("a%20b.bin"), SQUARE, fan, [0, 1], beside={"a b.bin": file.data})
    for mode, name, triangles in (
        (5, "strip", [[0, 1, 2], [1, 3, 2]]),
        (6, "fan", [[1, 2, 0], [2, 3, 0]]),
        (None, "loose", [[0, 1, 2]]),
    ):
        file = Gltf()
        points = SQUARE[:3] if mode is None else SQUARE
        file.mesh(file.primitive(points, **({} if mode is None else {"mode": mode})), camera=0)
        file.mesh(file.primitive(SQUARE, [0, 1], mode=1))  # a line
        yield Ugly(f"{name}.glb", file.glb(), points, triangles, list(range(len(triangles))))
    yield Ugly("nodes.gltf", tree().json(), *_TREE)
    file = Gltf()
    normals = file.add([[0, 0, 127]] * 4, 5120, gap=1, normalized=True)
    position = file.add([[0, 0, 0], [255, 0, 0], [255, 255, 0], [0, 255, 0]], 5121, gap=5, normalized=True)
    indices = file.add([0, 1, 2, 0, 2, 3], 5125)
    file.mesh({"attributes": {"POSITION": position, "NORMAL": normals}, "indices": indices})
    yield Ugly("quantized.glb", file.glb(), SQUARE, fan, [0, 1], with_normals=True)
    file = Gltf()
    primitive = file.primitive([[7, 7, 7], *SQUARE[1:]], [0, 1, 2, 0, 2, 3])
    sparse = {
        "count": 1,
        "indices": {"bufferView": file.view(b"\0"), "componentType": 5121},
        "values": {"bufferView": file.view(struct.pack("<3f", 0, 0, 0))},
    }
    file.tree["accessors"][primitive["attributes"]["POSITION"]]["sparse"] = sparse
    file.mesh(primitive)
    yield Ugly("sparse.glb", file.glb(), SQUARE, fan, [0, 1])


def tree() -> Gltf:
    """Nodes in nodes: 2 (moved), its child 0 (doubled), then 1 (mirrored), which shares the mesh of 0."""
    file = Gltf()
    file.mesh(file.primitive(SQUARE[:3]), scale=[2, 2, 2])
    file.tree["nodes"] += [{"mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1]}]
    file.tree["nodes"] += [{"children": [0], "translation": [0, 0, 3], "rotation": [0, 0, 1, 0]}]
    file.tree |= {"scene": 1, "scenes": [{"nodes": [1]}, {"nodes": [2, 1]}], "extensionsUsed": ["EXT_any"]}
    return file


_TREE = (
    [[0, 0, 3], [-2, 0, 3], [-2, -2, 3], [5, 0, 0], [4, 0, 0], [4, 1, 0]],
    [[0, 1, 2], [3, 5, 4]],
    [0, 1],
)

UGLY = {ugly.file: ugly for kind in (obj_files, ply_files, stl_files, gltf_files) for ugly in kind()}
"""All files by name."""


def without(file: Gltf, key: str) -> bytes:
    """The JSON of a file without one of its keys."""
    return json.dumps({k: v for k, v in json.loads(file.json()).items() if k != key}).encode()
