"""Reads vertices, normals and faces of a PLY file, ascii or binary, in the file's order.

Own code, because trimesh puts triangles before larger polygons and misreads binary files that mix them.
Turk, The PLY Polygon File Format, 1994.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tracer.errors import SceneError
from tracer.messages import LONGEST_SHOWN
from tracer.shapes.ply_header import WIDTHS, Element, read_header
from tracer.shapes.polygons import PolygonSoup, check_faces
from tracer.shapes.words import short

_FACE_LISTS = ("vertex_indices", "vertex_index")
_MOST = 2**53  # numbers beyond name nothing


def read_ply(path: Path) -> PolygonSoup:
    """The polygons of a PLY file; `SceneError` says what is wrong with it."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SceneError(f"{path}: cannot be read ({error.strerror})") from None
    try:
        order, elements, body = read_header(data)
        reader = _Reader(body, order)
        values = {element.name: reader.read(element) for element in elements}
        vertices, normals = _vertices(values["vertex"])
        corners, sizes = _faces(values.get("face", {}))
    except (ValueError, KeyError) as error:
        raise SceneError(f"{path}: is damaged or no PLY file ({error})") from None
    check_faces(path, corners, sizes, len(vertices))
    return PolygonSoup(vertices, normals, corners, sizes, corners)


# ---- Body --------------------------------------------------------------------------------------


class _Reader:
    """Reads one element after the other from words (order "", line ends are spaces like others) or bytes."""

    def __init__(self, body: bytes, order: str) -> None:
        self._stream: Any = body if order else _numbers(body)
        self._widths = WIDTHS if order else dict.fromkeys(WIDTHS, 1)
        self._order, self._at = order, 0

    def read(self, element: Element) -> dict[str, Any]:
        """A column per property; for lists (all numbers in a row, lengths)."""
        kinds = element.properties
        smallest = sum(self._widths[length or kind] for kind, length in kinds.values())
        if element.count * smallest > len(self._stream) - self._at:
            raise ValueError(f"it ends before its {element.count} entries of `{short(element.name)}`")
        if not any(length_kind for _, length_kind in kinds.values()):
            return self._table(element.count, {name: kind for name, (kind, _) in kinds.items()})
        uniform = self._uniform(element) if self._order and element.count else None
        if uniform is not None:
            return uniform
        columns = [(list[float](), list[int](), *kind) for kind in kinds.values()]
        for _ in range(element.count):
            for numbers, lengths, kind, length_kind in columns:
                length = self._length(length_kind) if length_kind else 1
                numbers.extend(self._take(kind, length))
                lengths.append(length)
        pairs = zip(kinds, columns, strict=True)
        return {name: column[:2] if column[3] else column[0] for name, column in pairs}

    def _uniform(self, element: Element) -> dict[str, Any] | None:
        """The columns of an element whose lists are all as long as those of its first entry; else None."""
        start, layout = self._at, list[tuple[Any, ...]]()
        lists = list[tuple[str, int]]()
        for name, (kind, length_kind) in element.properties.items():
            length = self._length(length_kind) if length_kind else 1
            self._take(kind, length)
            if length_kind:
                lists.append((name, length))
                layout.append((f"length of {name}", self._order + length_kind))
            layout.append((name, self._order + kind, (length,)))
        size, self._at = self._at - start, start
        if size * element.count > len(self._stream) - start:
            return None
        rows: Any = np.frombuffer(self._stream, np.dtype(layout), element.count, start)
        if not all((rows[f"length of {name}"] == length).all() for name, length in lists):
            return None
        self._at += size * element.count
        columns: dict[str, Any] = {name: rows[name].reshape(-1) for name in element.properties}
        return columns | {name: (columns[name], np.full(len(rows), length)) for name, length in lists}

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


def _faces(columns: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """The vertex numbers of all faces, not yet checked against the number of vertices, and the size of
    each."""
    key = next((name for name in _FACE_LISTS if isinstance(columns.get(name), tuple)), None)
    numbers, lengths = (np.asarray(column) for column in columns[key]) if key else (np.zeros(0), np.zeros(0))
    lengths = lengths.astype(np.int64)
    if (lengths < 3).any():
        raise ValueError(f"face {np.argmax(lengths < 3)} has fewer than three corners")
    if not (np.isfinite(numbers) & (np.floor(numbers) == numbers)).all():
        raise ValueError("a face names a vertex that is no whole number")
    return np.clip(numbers, -_MOST, _MOST).astype(np.int64), lengths
