"""The triangles of glTF and GLB files for `reference.plain`: nodes in order, each before its children.

For sound files: nothing is checked here. Points, lines, materials and skins are skipped.
"""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from reference.plain_polygons import Corners, MeshFile, Point

Matrix = list[list[float]]
CODES = {5120: "b", 5121: "B", 5122: "h", 5123: "H", 5125: "I", 5126: "f"}
WIDTHS = {"SCALAR": 1, "VEC3": 3}


def read_gltf(path: Path) -> MeshFile:
    """The triangles of all nodes; their vertices are placed."""
    data = path.read_bytes()
    binary = b""
    if data[:4] == b"glTF":
        length = int.from_bytes(data[12:16], "little")
        data, binary = data[20 : 20 + length], data[28 + length :]
    tree = json.loads(data.decode("utf-8-sig"))
    buffers = [buffer_bytes(buffer.get("uri"), binary, path.parent) for buffer in tree.get("buffers", [])]
    vertices: list[Point] = []
    triangles: list[Corners] = []
    normals: list[Point | None] = []
    one = [[float(i == j) for j in range(4)] for i in range(4)]
    for number in root_nodes(tree):
        for mesh, matrix in meshes_below(tree, number, one):
            for primitive in tree["meshes"][mesh]["primitives"]:
                first, mirrored = len(vertices), determinant(matrix) < 0
                faces = list(primitive_triangles(tree, buffers, primitive))
                triangles += [
                    (first + a, first + c, first + b) if mirrored else (first + a, first + b, first + c)
                    for a, b, c in faces
                ]
                if primitive.get("mode", 4) > 3:
                    points = values(tree, buffers, primitive["attributes"]["POSITION"])
                    vertices += [moved(matrix, p) for p in points]
                    given = primitive["attributes"].get("NORMAL")
                    if given is None:
                        normals += [None] * len(points)
                    else:
                        normals += [turned(matrix, n, mirrored) for n in values(tree, buffers, given)]
    if any(normal is None for normal in normals):
        return MeshFile(vertices, triangles)
    known = [normal for normal in normals if normal is not None]
    return MeshFile(vertices, triangles, [(known[a], known[b], known[c]) for a, b, c in triangles])


def buffer_bytes(uri: str | None, binary: bytes, folder: Path) -> bytes:
    """The bytes of a buffer: in the container, in its URI, or in a file."""
    if uri is None:
        return binary
    if uri.startswith("data:"):
        return base64.b64decode(uri.partition(",")[2])
    return (folder / unquote(uri)).read_bytes()


def values(tree: Any, buffers: list[bytes], number: int) -> list[Any]:
    """What an accessor names: tuples of three, or numbers."""
    accessor = tree["accessors"][number]
    width, code = WIDTHS[accessor["type"]], CODES[accessor["componentType"]]
    rows = unpacked(tree, buffers, accessor, f"<{width}{code}", accessor["count"])
    if "sparse" in accessor:
        sparse = accessor["sparse"]
        form = f"<{CODES[sparse['indices']['componentType']]}"
        places = unpacked(tree, buffers, sparse["indices"], form, sparse["count"])
        news = unpacked(tree, buffers, sparse["values"], f"<{width}{code}", sparse["count"])
        for (place,), new in zip(places, news, strict=True):
            rows[place] = new
    if accessor.get("normalized"):
        largest = 2 ** (8 * struct.calcsize(code) - code.islower()) - 1
        rows = [tuple(max(x / largest, -1.0) for x in row) for row in rows]
    return [row[0] for row in rows] if width == 1 else rows


def unpacked(tree: Any, buffers: list[bytes], owner: Any, form: str, count: int) -> list[tuple[Any, ...]]:
    """`count` rows of a buffer view."""
    view = tree["bufferViews"][owner["bufferView"]]
    start = view.get("byteOffset", 0) + owner.get("byteOffset", 0)
    step = view.get("byteStride", struct.calcsize(form))
    return [struct.unpack_from(form, buffers[view["buffer"]], start + k * step) for k in range(count)]


def root_nodes(tree: Any) -> list[int]:
    """The nodes of the scene; without scenes those that no node names as a child."""
    if "scenes" in tree:
        roots: list[int] = tree["scenes"][tree.get("scene", 0)].get("nodes", [])
        return roots
    nodes = tree.get("nodes", [])
    return [k for k in range(len(nodes)) if not any(k in node.get("children", []) for node in nodes)]


def meshes_below(tree: Any, number: int, above: Matrix) -> Iterator[tuple[int, Matrix]]:
    """Meshes and where they stand: that of a node, then those of its children."""
    node = tree["nodes"][number]
    own = node_matrix(node)
    matrix = [[sum(above[i][k] * own[k][j] for k in range(4)) for j in range(4)] for i in range(4)]
    if "mesh" in node:
        yield node["mesh"], matrix
    for child in node.get("children", []):
        yield from meshes_below(tree, child, matrix)


def node_matrix(node: Any) -> Matrix:
    """The node's matrix, or T R S."""
    if "matrix" in node:
        return [[float(node["matrix"][4 * j + i]) for j in range(4)] for i in range(4)]
    tx, ty, tz = node.get("translation", (0.0, 0.0, 0.0))
    sx, sy, sz = node.get("scale", (1.0, 1.0, 1.0))
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    s = 2 / (x * x + y * y + z * z + w * w)
    return [
        [(1 - s * (y * y + z * z)) * sx, s * (x * y - z * w) * sy, s * (x * z + y * w) * sz, tx],
        [s * (x * y + z * w) * sx, (1 - s * (x * x + z * z)) * sy, s * (y * z - x * w) * sz, ty],
        [s * (x * z - y * w) * sx, s * (y * z + x * w) * sy, (1 - s * (x * x + y * y)) * sz, tz],
        [0.0, 0.0, 0.0, 1.0],
    ]


def primitive_triangles(tree: Any, buffers: list[bytes], primitive: Any) -> Iterator[Corners]:
    """Vertex numbers of triangles, strips and fans."""
    mode = primitive.get("mode", 4)
    count = tree["accessors"][primitive["attributes"]["POSITION"]]["count"]
    corners = values(tree, buffers, primitive["indices"]) if "indices" in primitive else list(range(count))
    if mode == 4:
        yield from zip(corners[::3], corners[1::3], corners[2::3], strict=True)
    for k in range(len(corners) - 2):
        if mode == 5:
            yield (
                (corners[k], corners[k + 1], corners[k + 2])
                if k % 2 == 0
                else (
                    corners[k],
                    corners[k + 2],
                    corners[k + 1],
                )
            )
        elif mode == 6:
            yield corners[k + 1], corners[k + 2], corners[0]


def moved(m: Matrix, p: Point) -> Point:
    """A point under a matrix."""
    x, y, z = (a * p[0] + b * p[1] + c * p[2] + d for a, b, c, d in m[:3])
    return x, y, z


def turned(m: Matrix, n: Point, mirrored: bool) -> Point:
    """A normal under a matrix: cross products of its columns, which are the columns of the cofactors."""
    a, b, c = ([m[i][j] for i in range(3)] for j in range(3))
    sign = -1.0 if mirrored else 1.0
    x, y, z = (
        sum(
            sign * column[i] * k for column, k in zip((cross(b, c), cross(c, a), cross(a, b)), n, strict=True)
        )
        for i in range(3)
    )
    return x, y, z


def determinant(m: Matrix) -> float:
    """Of the linear part."""
    a, b, c = ([m[i][j] for i in range(3)] for j in range(3))
    return sum(x * y for x, y in zip(a, cross(b, c), strict=True))


def cross(a: list[float], b: list[float]) -> list[float]:
    """a x b."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
