"""Reads vertices, normals and faces of a PLY file, ascii or binary, in the file's order.

Own code, because trimesh puts triangles before larger polygons and misreads binary files that mix them.
Turk, The PLY Polygon File Format, 1994.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tracer.errors import SceneError
from tracer.messages import LONGEST_SHOWN
from tracer.shapes.polygons import PolygonSoup, check_faces

_TYPES = {  # the old and the new names of the types of numbers, as `struct` and NumPy write them
    **dict(zip("char uchar short ushort int uint float double".split(), "bBhHiIfd", strict=True)),
    **dict(zip("int8 uint8 int16 uint16 int32 uint32 float32 float64".split(), "bBhHiIfd", strict=True)),
}
_WIDTHS = {kind: struct.calcsize(f"={kind}") for kind in _TYPES.values()}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_FACE_LISTS = ("vertex_indices", "vertex_index")


@dataclass
class _Element:
    """One element of the header: its properties, name to (type, type of the list's length or None)."""

    name: str
    count: int
    properties: dict[str, tuple[str, str | None]] = field(default_factory=dict)


def read_ply(path: Path) -> PolygonSoup:
    """The polygons of a PLY file; `SceneError` says what is wrong with it."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SceneError(f"{path}: cannot be read ({error.strerror})") from None
    try:
        order, elements, body = _header(data)
        reader = _Reader(body, order)
        values = {element.name: reader.read(element) for element in elements}
        vertices, normals = _vertices(values["vertex"])
        faces = _faces(values.get("face", {}))
    except (ValueError, KeyError) as error:
        raise SceneError(f"{path}: is damaged or no PLY file ({error})") from None
    check_faces(path, faces, len(vertices), "vertex")
    face_normals = faces if len(normals) else [[-1] * len(polygon) for polygon in faces]
    return PolygonSoup(vertices, normals, faces, face_normals)


# ---- Header ------------------------------------------------------------------------------------


def _header(data: bytes) -> tuple[str, list[_Element], bytes]:
    """Byte order ("" for ascii), elements, and what follows the header."""
    start = re.match(rb"ply[ \t]*(\r\n|\n|\r)", data)
    newline = b"\r" if start and start[1] == b"\r" else b"\n"
    end = re.search(newline + rb"end_header[ \t\r]*?" + newline, data)
    if start is None or end is None:
        raise ValueError("it has no PLY header")
    form, elements = "missing", list[_Element]()
    for number, line in enumerate(data[: end.start()].decode("ascii", errors="replace").splitlines(), 1):
        words = line.split()
        try:
            if words[:1] == ["format"]:
                form = words[1]
            elif words[:1] == ["element"]:
                elements.append(_element(words, elements))
            elif words[:1] == ["property"]:
                _add_property(words, elements[-1])
        except (ValueError, KeyError, IndexError):
            raise ValueError(f"line {number} of its header is `{line.strip()[:LONGEST_SHOWN]}`") from None
    if form not in _ORDERS:
        raise ValueError(f"its format is {form[:LONGEST_SHOWN]}")
    return _ORDERS[form], elements, data[end.end() :]


def _element(words: list[str], others: list[_Element]) -> _Element:
    """`element NAME COUNT`; ValueError where that is wrong or said before."""
    _, name, count = words
    if int(count) < 0 or any(other.name == name for other in others):
        raise ValueError
    return _Element(name, int(count))


def _add_property(words: list[str], element: _Element) -> None:
    """`property TYPE NAME` or `property list TYPE TYPE NAME`; ValueError or KeyError where that is wrong."""
    *kinds, name = words[1:]
    if name in element.properties:
        raise ValueError
    if kinds[:1] == ["list"]:
        _, length, kind = kinds
        element.properties[name] = _TYPES[kind], _TYPES[length]
    else:
        (kind,) = kinds
        element.properties[name] = _TYPES[kind], None


# ---- Body --------------------------------------------------------------------------------------


class _Reader:
    """Reads one element after the other from words (order "", line ends are spaces like others) or bytes."""

    def __init__(self, body: bytes, order: str) -> None:
        self._stream: Any = body if order else _numbers(body)
        self._widths = _WIDTHS if order else dict.fromkeys(_WIDTHS, 1)
        self._order, self._at = order, 0

    def read(self, element: _Element) -> dict[str, Any]:
        """A column per property; for lists (all numbers in a row, lengths)."""
        kinds = element.properties
        smallest = sum(self._widths[length or kind] for kind, length in kinds.values())
        if element.count * smallest > len(self._stream) - self._at:
            raise ValueError(f"it ends before its {element.count} entries of `{element.name}`")
        if not any(length_kind for _, length_kind in kinds.values()):
            return self._table(element.count, {name: kind for name, (kind, _) in kinds.items()})
        columns = [(list[float](), list[int](), *kind) for kind in kinds.values()]
        for _ in range(element.count):
            for numbers, lengths, kind, length_kind in columns:
                length = self._length(length_kind) if length_kind else 1
                numbers.extend(self._take(kind, length))
                lengths.append(length)
        pairs = zip(kinds, columns, strict=True)
        return {name: column[:2] if column[3] else column[0] for name, column in pairs}

    def _length(self, kind: str) -> int:
        (number,) = self._take(kind, 1)
        if not number >= 0 or number % 1 != 0:
            raise ValueError(f"a list has the length {number}")
        return int(number)

    def _take(self, kind: str, count: int) -> Sequence[float]:
        """The next `count` numbers of a type; ValueError where there are fewer."""
        start, size = self._at, count * self._widths[kind]
        if size > len(self._stream) - start:
            raise ValueError("it ends too early")
        self._at += size
        if self._order:
            return struct.unpack_from(f"{self._order}{count}{kind}", self._stream, start)
        numbers: list[float] = self._stream[start : self._at]
        return numbers

    def _table(self, count: int, kinds: dict[str, str]) -> dict[str, Any]:
        """The columns of `count` entries without lists, whose place in the file was checked."""
        if not self._order:
            numbers = self._take("d", count * len(kinds))
            return {name: numbers[k :: len(kinds)] for k, name in enumerate(kinds)}
        layout = np.dtype([(name, self._order + kind) for name, kind in kinds.items()])
        rows: Any = np.frombuffer(self._stream, layout, count, self._at) if kinds else None
        self._at += layout.itemsize * count
        return {name: rows[name] for name in kinds}


def _numbers(body: bytes) -> list[float]:
    try:
        return list(map(float, body.split()))
    except ValueError as error:
        wrong = str(error).rpartition(": b")[2]
        raise ValueError(f"{wrong[:LONGEST_SHOWN]} is not a number") from None


# ---- Geometry ----------------------------------------------------------------------------------


def _vertices(columns: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Positions and normals (n, 3); no normals (0, 3) unless all three components are there."""
    vertices = _vectors(columns, ("x", "y", "z"))
    with np.errstate(over="ignore"):
        sound = np.isfinite(vertices.astype(np.float32)).all(axis=1)
    if not sound.all():
        what = f"vertex {np.argmin(sound)}, counted from 0,"
        raise ValueError(f"{what} is not finite or leaves the range of single precision")
    if not {"nx", "ny", "nz"} <= columns.keys():
        return vertices, np.zeros((0, 3))
    normals = _vectors(columns, ("nx", "ny", "nz"))
    sound = np.isfinite(normals).all(axis=1)
    if not sound.all():
        raise ValueError(f"the normal of vertex {np.argmin(sound)}, counted from 0, is not finite")
    return vertices, normals


def _vectors(columns: dict[str, Any], names: tuple[str, str, str]) -> np.ndarray:
    for name in names:
        if isinstance(columns.get(name, ()), tuple):
            raise ValueError(f"its vertices have no number `{name}`")
    return np.column_stack([np.asarray(columns[name], np.float64) for name in names])


def _faces(columns: dict[str, Any]) -> list[list[int]]:
    """The vertex numbers of each face, not yet checked against the number of vertices."""
    key = next((name for name in _FACE_LISTS if isinstance(columns.get(name), tuple)), None)
    numbers, lengths = columns[key] if key else ([], [])
    if min(lengths, default=3) < 3:
        number = next(number for number, length in enumerate(lengths) if length < 3)
        raise ValueError(f"face {number} has fewer than three corners")
    if not all(map(float.is_integer, map(float, numbers))):
        raise ValueError("a face names a vertex that is no whole number")
    corners, ends = list(map(int, numbers)), np.cumsum(lengths, dtype=np.int64).tolist()
    return [corners[end - length : end] for end, length in zip(ends, lengths, strict=True)]
