"""Reads the geometry of a Wavefront OBJ file: `v`, `vn` and `f`, in the file's order.

Own code, because the readers on offer either regroup faces or have no wheel for every Python version that
this project supports. Skipped: materials, groups, lines, texture coordinates, and what follows the third
number of a vertex (weight or color). A face may name vertices and normals that come later in the file;
negative numbers count back from the last one read so far.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tracer.errors import SceneError
from tracer.shapes.polygons import PolygonSoup
from tracer.shapes.words import lines_of, short, three_floats

_MOST = 2**31  # numbers from here on name nothing: no file holds as many vertices


@dataclass
class _Points:
    """All `v` or all `vn` of a file: three numbers each, in one row, and the line of each."""

    numbers: list[float] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)

    def array(self) -> np.ndarray:
        """(n, 3)."""
        return np.array(self.numbers, np.float64).reshape(-1, 3)


@dataclass
class _Faces:
    """All `f` of a file: the corners of all faces in one row; for each face the number of its corners, its
    line, and how many vertices and normals were read before it (two numbers, in one row)."""

    corners: list[tuple[int, int]] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    read: list[int] = field(default_factory=list)

    def numbers(self, column: int, count: int, what: str) -> list[list[int]]:
        """For each face the numbers of its vertices (column 0) or normals (1), from 0; -1 where it has none.

        Raises `_Wrong` where there are only `count`.
        """
        written = np.array(self.corners, np.int64).reshape(-1, 2)[:, column]
        so_far = np.array(self.read, np.int64)[column::2].repeat(self.sizes)
        numbers = np.where(written > 0, written - 1, np.where(written < 0, so_far + written, -1))
        ends = np.cumsum(self.sizes, dtype=np.int64)
        wrong = (numbers >= count) | ((written < 0) & (numbers < 0))
        if wrong.any():
            place = int(np.argmax(wrong))
            face = int(np.searchsorted(ends, place, side="right"))
            problem = f"{what} {written[place]} does not exist"
            if written[place] > 0:
                problem = f"face {face} names {what} {numbers[place]}, counted from 0; the file has {count}"
            raise _Wrong(self.lines[face], problem)
        flat = numbers.tolist()
        return [flat[end - size : end] for end, size in zip(ends.tolist(), self.sizes, strict=True)]


class _Wrong(ValueError):
    """What is wrong with a line."""

    def __init__(self, line: int, problem: str) -> None:
        super().__init__(f"line {line}: {problem}")


def read_obj(path: Path) -> PolygonSoup:
    """The polygons of an OBJ file; `SceneError` names the line that is wrong."""
    try:
        text = path.read_bytes().decode("utf-8-sig", errors="replace")
    except OSError as error:
        raise SceneError(f"{path}: cannot be read ({error.strerror})") from None
    try:
        return _polygons(text)
    except _Wrong as wrong:
        raise SceneError(f"{path}, {wrong}") from None


def _polygons(text: str) -> PolygonSoup:
    """The polygons of the text of an OBJ file; raises `_Wrong`."""
    points, faces = _statements(text)
    vertices, normals = points["v"].array(), points["vn"].array()
    with np.errstate(over="ignore"):
        rounded = vertices.astype(np.float32)
    problem = "a vertex is not finite or leaves the range of single precision"
    _check_finite(rounded, points["v"].lines, problem)
    _check_finite(normals, points["vn"].lines, "a normal is not finite")
    return PolygonSoup(
        vertices, normals, faces.numbers(0, len(vertices), "vertex"), faces.numbers(1, len(normals), "normal")
    )


def _statements(text: str) -> tuple[dict[str, _Points], _Faces]:
    points, faces, corners = {"v": _Points(), "vn": _Points()}, _Faces(), _Corners()
    vertex_lines, normal_lines = points["v"].lines, points["vn"].lines
    for line, words in _lines(text):
        keyword = words[0]
        try:
            if keyword in points:
                points[keyword].numbers.extend(three_floats(words))
                points[keyword].lines.append(line)
            elif keyword == "f":
                if len(words) < 4:
                    raise ValueError("has fewer than three corners")
                faces.corners.extend([corners[word] for word in words[1:]])
                faces.sizes.append(len(words) - 1)
                faces.lines.append(line)
                faces.read += len(vertex_lines), len(normal_lines)
        except ValueError as error:
            raise _Wrong(line, str(error)) from None
    return points, faces


def _lines(text: str) -> Iterator[tuple[int, list[str]]]:
    """(line number, words) of every line with content; a backslash at the end continues a line."""
    pending = ""
    first = 0
    # The empty line at the end completes a last line that ends with a backslash.
    for number, line in enumerate([*lines_of(text), ""], 1):
        line = line.partition("#")[0].rstrip()
        first = first if pending else number
        if line.endswith("\\"):
            pending += line[:-1] + " "
            continue
        words = (pending + line).split()
        pending = ""
        if words:
            yield first, words


class _Corners(dict[str, tuple[int, int]]):
    """From `v`, `v/vt`, `v//vn` or `v/vt/vn` to the numbers of vertex and normal as written, 0 for no normal.

    A word is parsed where it is first seen: most corners of a mesh come up about six times.
    """

    def __missing__(self, word: str) -> tuple[int, int]:
        vertex, *texture_and_normal = word.split("/")
        normal = texture_and_normal[1] if len(texture_and_normal) > 1 else ""
        try:
            if "_" in word or len(texture_and_normal) > 2:
                raise ValueError
            numbers = _written_number(vertex), _written_number(normal) if normal else 0
        except ValueError:
            raise ValueError(f"`{short(word)}` is no corner of a face (v, v/vt, v//vn or v/vt/vn)") from None
        if numbers[0] == 0 or (normal and numbers[1] == 0):
            raise ValueError(f"{'normal' if numbers[0] else 'vertex'} 0 does not exist")
        self[word] = numbers
        return numbers


def _written_number(word: str) -> int:
    """A whole number, brought down to a size that an array holds; it names nothing either way."""
    return min(max(int(word), -_MOST), _MOST)


def _check_finite(points: np.ndarray, lines: list[int], problem: str) -> None:
    finite = np.isfinite(points).all(axis=1)
    if not finite.all():
        raise _Wrong(lines[int(np.argmin(finite))], problem)
