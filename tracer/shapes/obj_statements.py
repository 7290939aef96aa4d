"""The statements of an OBJ file that matter here, `v`, `vn` and `f`, and how each line of them is read."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields

import numpy as np

from tracer.shapes.words import lines_of, short, three_floats

MOST = 2**31 - 1
"""Numbers from here on name nothing: no file holds as many vertices."""


class WrongLine(ValueError):
    """What is wrong with a line."""

    def __init__(self, line: int, problem: str) -> None:
        super().__init__(f"line {line}: {problem}")


@dataclass(frozen=True)
class Statements:
    """The statements of a piece of a file.

    `vertices` (n, 3), `normals` (k, 3) with the line of each; `corners` (c, 2) int32: the numbers of vertex
    and normal of all corners of all faces as written, 0 for no normal; of each face its number of corners
    `sizes`, its line, and `before` (f, 2) int32, how many vertices and normals were read before it.
    """

    vertices: np.ndarray
    vertex_lines: np.ndarray
    normals: np.ndarray
    normal_lines: np.ndarray
    corners: np.ndarray
    sizes: np.ndarray
    face_lines: np.ndarray
    before: np.ndarray


@dataclass
class _Points:
    """All `v` or all `vn`: three numbers each, in one row, and the line of each."""

    numbers: list[float] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)


def read_statements(text: str, first_line: int) -> Statements:
    """The statements of a text that begins at a line; raises `WrongLine`."""
    points, corner_of = {"v": _Points(), "vn": _Points()}, _Corners()
    vertices, normals = points["v"], points["vn"]
    corners = list[tuple[int, int]]()
    faces = list[tuple[int, int, int, int]]()
    for line, words in _lines(text, first_line):
        keyword = words[0]
        try:
            if keyword in points:
                points[keyword].numbers.extend(three_floats(words))
                points[keyword].lines.append(line)
            elif keyword == "f":
                if len(words) < 4:
                    raise ValueError("has fewer than three corners")
                corners.extend([corner_of[word] for word in words[1:]])
                faces.append((len(words) - 1, line, len(vertices.lines), len(normals.lines)))
        except ValueError as error:
            raise WrongLine(line, str(error)) from None
    table = _whole(faces, 4)
    return Statements(
        vertices=np.array(vertices.numbers, np.float64).reshape(-1, 3),
        vertex_lines=np.array(vertices.lines, np.int64),
        normals=np.array(normals.numbers, np.float64).reshape(-1, 3),
        normal_lines=np.array(normals.lines, np.int64),
        corners=_whole(corners, 2).astype(np.int32),
        sizes=table[:, 0].astype(np.int32),
        face_lines=table[:, 1],
        before=table[:, 2:].astype(np.int32),
    )


def joined(pieces: list[Statements]) -> Statements:
    """The statements of pieces one after the other, which are used up: a large file should not be in memory
    twice."""
    columns = {field.name: [getattr(piece, field.name) for piece in pieces] for field in fields(Statements)}
    pieces.clear()
    return Statements(**{name: np.concatenate(columns.pop(name)) for name in list(columns)})


def _whole(rows: Sequence[Sequence[int]], columns: int) -> np.ndarray:
    return np.array(rows, np.int64).reshape(-1, columns)


def _lines(text: str, first_line: int) -> Iterator[tuple[int, list[str]]]:
    """(line number, words) of every line with content; a backslash at the end continues a line."""
    pending = ""
    first = 0
    # The empty line at the end completes a last line that ends with a backslash.
    for number, line in enumerate([*lines_of(text), ""], first_line):
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
    return min(max(int(word), -MOST), MOST)
