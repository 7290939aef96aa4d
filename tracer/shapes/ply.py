"""Reads vertices, normals and faces of a PLY file, ascii or binary, in the file's order.

Own code, because trimesh puts triangles before larger polygons and misreads binary files that mix them.
Turk, The PLY Polygon File Format, 1994.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tracer.errors import SceneError
from tracer.shapes.polygons import PolygonSoup, check_faces

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_FACE_LISTS = ("vertex_indices", "vertex_index")


@dataclass
class _Element:
    """One element of the header: its properties as (name, type, type of the list's length or None)."""

    name: str
    count: int
    properties: list[tuple[str, str, str | None]] = field(default_factory=list)

    @property
    def has_lists(self) -> bool:
        """Whether entries differ in length."""
        return any(length is not None for _, _, length in self.properties)


def read_ply(path: Path) -> PolygonSoup:
    """The polygons of a PLY file; `SceneError` says what is wrong with it."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SceneError(f"{path}: cannot be read ({error.strerror})") from None
    try:
        order, elements, body = _header(data)
        reader: _Reader = _AsciiReader(body) if not order else _BinaryReader(body, order)
        values = {element.name: reader.read(element) for element in elements}
        return _soup(path, values)
    except (ValueError, KeyError, IndexError, OverflowError) as error:
        raise SceneError(f"{path}: is damaged or no PLY file ({error})") from None


def _header(data: bytes) -> tuple[str, list[_Element], bytes]:
    """Byte order ("" for ascii), elements, and what follows the header."""
    head, mark, rest = data.partition(b"end_header")
    if not data.startswith(b"ply") or not mark:
        raise ValueError("it has no PLY header")
    body = rest.partition(b"\n")[2]
    form, elements = None, list[_Element]()
    for line in head.decode("ascii", errors="replace").splitlines():
        words = line.split()
        if words[:1] == ["format"]:
            form = words[1]
        elif words[:1] == ["element"]:
            elements.append(_Element(words[1], int(words[2])))
        elif words[:2] == ["property", "list"]:
            elements[-1].properties.append((words[4], _TYPES[words[3]], _TYPES[words[2]]))
        elif words[:1] == ["property"]:
            elements[-1].properties.append((words[2], _TYPES[words[1]], None))
    if form not in _ORDERS:
        raise ValueError(f"its format is {form}")
    if any(element.count < 0 for element in elements):
        raise ValueError("an element has a negative count")
    return _ORDERS[form], elements, body


class _Reader:
    """Reads one element after the other: a column per property, for lists a Python list of arrays."""

    def read(self, element: _Element) -> dict[str, Any]:
        """The columns of the next element."""
        self.check_size(element)
        if not element.has_lists:
            return self.read_table(element)
        columns: dict[str, list[Any]] = {name: [] for name, _, _ in element.properties}
        for _ in range(element.count):
            for name, kind, length_kind in element.properties:
                if length_kind is None:
                    columns[name].append(self.take(kind, 1)[0])
                else:
                    columns[name].append(self.take(kind, int(self.take(length_kind, 1)[0])))
        return columns

    def check_size(self, element: _Element) -> None:
        """Raises ValueError where the file is too short for what the header promises."""
        raise NotImplementedError

    def read_table(self, element: _Element) -> dict[str, Any]:
        """The columns of an element without lists."""
        raise NotImplementedError

    def take(self, kind: str, count: int) -> np.ndarray:
        """The next `count` numbers of a type."""
        raise NotImplementedError


class _AsciiReader(_Reader):
    def __init__(self, body: bytes) -> None:
        self._words = body.split()
        self._at = 0

    def check_size(self, element: _Element) -> None:
        if element.count * len(element.properties) > len(self._words) - self._at:
            raise ValueError(f"it ends before its {element.count} entries of `{element.name}`")

    def read_table(self, element: _Element) -> dict[str, Any]:
        width = len(element.properties)
        table = self.take("f8", element.count * width).reshape(element.count, width)
        return {name: table[:, k] for k, (name, _, _) in enumerate(element.properties)}

    def take(self, kind: str, count: int) -> np.ndarray:
        words = self._words[self._at : self._at + count]
        if count < 0 or len(words) < count:
            raise ValueError("it ends too early")
        self._at += count
        return np.array(words, "f8")


class _BinaryReader(_Reader):
    def __init__(self, body: bytes, order: str) -> None:
        self._body, self._order, self._at = body, order, 0

    def check_size(self, element: _Element) -> None:
        smallest = sum(int(np.dtype(length or kind).itemsize) for _, kind, length in element.properties)
        if element.count * smallest > len(self._body) - self._at:
            raise ValueError(f"it ends before its {element.count} entries of `{element.name}`")

    def read_table(self, element: _Element) -> dict[str, Any]:
        layout = np.dtype([(name, self._order + kind) for name, kind, _ in element.properties])
        table = np.frombuffer(self._body, layout, element.count, self._at)
        self._at += layout.itemsize * element.count
        return {name: table[name].astype(np.float64) for name, _, _ in element.properties}

    def take(self, kind: str, count: int) -> np.ndarray:
        layout = np.dtype(self._order + kind)
        if count < 0 or layout.itemsize * count > len(self._body) - self._at:
            raise ValueError("it ends too early")
        values = np.frombuffer(self._body, layout, count, self._at)
        self._at += layout.itemsize * count
        return values


def _soup(path: Path, values: dict[str, dict[str, Any]]) -> PolygonSoup:
    """The polygons from the columns of the elements `vertex` and `face`."""
    vertex, face = values["vertex"], values.get("face", {})
    vertices = np.column_stack([vertex[name] for name in "xyz"]).astype(np.float64)
    normals: np.ndarray = np.zeros((0, 3))
    if all(name in vertex for name in ("nx", "ny", "nz")):
        normals = np.column_stack([vertex[name] for name in ("nx", "ny", "nz")]).astype(np.float64)
    key = next((name for name in _FACE_LISTS if name in face), None)
    faces = [polygon.astype(np.int64).tolist() for polygon in face[key]] if key else []
    for number, polygon in enumerate(faces):
        if len(polygon) < 3:
            raise SceneError(f"{path}: face {number} has fewer than three corners")
    check_faces(path, faces, len(vertices), "vertex")
    face_normals = faces if len(normals) else [[-1] * len(polygon) for polygon in faces]
    return PolygonSoup(vertices, normals, faces, face_normals)
