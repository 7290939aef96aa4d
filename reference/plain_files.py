"""Meshes and pictures for `reference.plain`: OBJ, PLY, STL, PNG and JPEG files, and the two built-in solids.

Indices start at 0; picture values are display values in [0, 1] (document, sections 5 and 6).
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from reference.plain_gltf import read_gltf
from reference.plain_polygons import MeshFile, Point, cut_polygons

Take = Callable[[str, int], Any]  # the next `count` numbers of a type


# Wound outward; the cube's faces are -x +x -y +y -z +z, the tetrahedron's face k is opposite to corner k.
BUILTIN_MESHES = {
    "cube": cut_polygons(
        [(x, y, z) for z in (-1.0, 1.0) for y in (-1.0, 1.0) for x in (-1.0, 1.0)],
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]],
    ),
    "tetrahedron": cut_polygons(
        [(1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)],
        [[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]],
    ),
}


def read_mesh(path: Path) -> MeshFile:
    """The mesh of a file, in the format that its ending says."""
    readers = {".obj": read_obj, ".ply": read_ply, ".stl": read_stl, ".gltf": read_gltf, ".glb": read_gltf}
    return readers[path.suffix.lower()](path)


def read_obj(path: Path) -> MeshFile:
    """The `v`, `vn` and `f` lines of a Wavefront OBJ file; everything else is skipped."""
    vertices: list[Point] = []
    normals: list[Point] = []
    polygons: list[list[int]] = []
    corner_normals: list[list[Point]] = []
    for keyword, *fields in obj_lines(path):
        if keyword == "v":
            vertices.append(point(fields[:3]))
        elif keyword == "vn":
            normals.append(point(fields))
        elif keyword == "f":
            corners = [corner.split("/") for corner in fields]
            polygons.append([obj_index(corner[0], len(vertices)) for corner in corners])
            with_normal = [corner[2] for corner in corners if len(corner) == 3 and corner[2]]
            corner_normals.append([normals[obj_index(number, len(normals))] for number in with_normal])
    complete = all(len(p) == len(n) for p, n in zip(polygons, corner_normals, strict=True))
    return cut_polygons(vertices, polygons, corner_normals if complete else None)


def obj_lines(path: Path) -> Iterator[list[str]]:
    """The words of each line that is not empty, without comments, continued lines joined."""
    text = path.read_text(encoding="utf-8", errors="replace").replace("\\\n", " ")
    for line in text.splitlines():
        words = line.partition("#")[0].split()
        if words:
            yield words


def obj_index(text: str, count: int) -> int:
    """OBJ counts from 1; negative numbers count back from the latest of `count` entries."""
    number = int(text)
    return number - 1 if number > 0 else count + number


PLY_CODES = {  # the old and the new names of the number types, as `struct` writes them
    **dict(zip("char uchar short ushort int uint float double".split(), "bBhHiIfd", strict=True)),
    **dict(zip("int8 uint8 int16 uint16 int32 uint32 float32 float64".split(), "bBhHiIfd", strict=True)),
}
PLY_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}


def read_ply(path: Path) -> MeshFile:
    """The vertices, polygons and (where given) `nx ny nz` of a PLY file, ASCII or binary.

    Own code: trimesh 4 puts triangles before larger polygons and cannot read binary files that mix them.
    """
    header, _, body = path.read_bytes().partition(b"end_header")
    body = body.partition(b"\n")[2]
    lines = [line.split() for line in header.decode("ascii", errors="replace").splitlines()]
    form = next(words[1] for words in lines if words[:1] == ["format"])
    take = ascii_values(body) if form == "ascii" else binary_values(body, PLY_ORDERS[form])
    elements = ply_elements(lines, take)
    vertices = [(v["x"], v["y"], v["z"]) for v in elements["vertex"]]
    faces = elements.get("face", [])
    key = "vertex_indices" if faces and "vertex_indices" in faces[0] else "vertex_index"
    polygons = [[int(k) for k in face[key]] for face in faces]
    if not vertices or "nx" not in elements["vertex"][0]:
        return cut_polygons(vertices, polygons)
    normals = [(v["nx"], v["ny"], v["nz"]) for v in elements["vertex"]]
    return cut_polygons(vertices, polygons, [[normals[k] for k in polygon] for polygon in polygons])


def ply_elements(lines: list[list[str]], take: Take) -> dict[str, list[dict[str, Any]]]:
    """All entries of all elements, in the order that the header announces."""
    layout: list[tuple[str, int, list[list[str]]]] = []
    for words in lines:
        if words[:1] == ["element"]:
            layout.append((words[1], int(words[2]), []))
        elif words[:1] == ["property"]:
            layout[-1][2].append(words[1:])
    return {name: [ply_entry(properties, take) for _ in range(count)] for name, count, properties in layout}


def ply_entry(properties: list[list[str]], take: Take) -> dict[str, Any]:
    """One vertex, face, ...: the value of each property, a list for `list COUNT_TYPE TYPE NAME`."""
    entry: dict[str, Any] = {}
    for kind, *rest, name in properties:
        if kind == "list":
            entry[name] = take(rest[1], int(take(rest[0], 1)[0]))
        else:
            entry[name] = take(kind, 1)[0]
    return entry


def ascii_values(body: bytes) -> Take:
    """A function that takes the next `count` numbers of a text."""
    words = iter(body.split())
    return lambda kind, count: [float(next(words)) for _ in range(count)]


def binary_values(body: bytes, order: str) -> Take:
    """A function that takes the next `count` numbers of a type from packed bytes."""
    stream = BytesIO(body)

    def take(kind: str, count: int) -> Any:
        layout = f"{order}{count}{PLY_CODES[kind]}"
        return struct.unpack(layout, stream.read(struct.calcsize(layout)))

    return take


def read_stl(path: Path) -> MeshFile:
    """The facets of an STL file, ascii or binary; each brings its own vertices."""
    data = path.read_bytes()
    count = int.from_bytes(data[80:84], "little")
    if len(data) == 84 + 50 * count:
        facets = [struct.unpack_from("<9f", data, 96 + 50 * k) for k in range(count)]
        vertices = [point(facet[i : i + 3]) for facet in facets for i in (0, 3, 6)]
    else:
        lines = (line.split() for line in data.decode("utf-8", errors="replace").lower().splitlines())
        named = ("solid", "endsolid")  # and any words as their names
        words = [word for line in lines if line and line[0] not in named for word in line]
        places_of_vertices = [k for k, word in enumerate(words) if word == "vertex"]
        vertices = [point(words[k + 1 : k + 4]) for k in places_of_vertices]
    first: dict[tuple[np.float32, ...], int] = {}
    places = [first.setdefault(tuple(map(np.float32, v)), number) for number, v in enumerate(vertices)]
    return MeshFile(vertices, [(k, k + 1, k + 2) for k in range(0, len(vertices), 3)], None, places)


def read_picture(path: Path) -> NDArray[np.float64]:
    """The (h, w, 3) display values in [0, 1] of a PNG or JPEG; gray is repeated, alpha dropped."""
    flags = cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION
    pixels = cv2.imdecode(np.frombuffer(path.read_bytes(), dtype=np.uint8), flags)
    if pixels is None:
        raise ValueError(f"{path}: not a PNG or JPEG picture")
    largest = np.iinfo(pixels.dtype).max
    channels = pixels.reshape(*pixels.shape[:2], -1).astype(np.float64) / largest
    if channels.shape[2] < 3:
        return np.repeat(channels[:, :, :1], 3, axis=2)
    return np.ascontiguousarray(channels[:, :, 2::-1])  # OpenCV stores blue, green, red


def point(values: Iterable[str | float]) -> Point:
    """Three numbers, those of a text as well."""
    x, y, z = values
    return (float(x), float(y), float(z))
