"""Reads the geometry of a Wavefront OBJ file: `v`, `vn` and `f`, in the file's order.

Own code, because the readers on offer either regroup faces or have no wheel for every Python version that
this project supports. Skipped: materials, groups, lines, texture coordinates, and what follows the third
number of a vertex (weight or color). A face may name vertices and normals that come later in the file;
negative numbers count back from the last one read so far.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tracer.errors import SceneError
from tracer.shapes.obj_blocks import read_block
from tracer.shapes.obj_statements import Statements, WrongLine, joined, read_statements
from tracer.shapes.polygons import PolygonSoup

BLOCK = 1 << 19
"""Bytes that are read at once, so that what is made of them stays near the processor."""

_MARK = b"\xef\xbb\xbf"


def read_obj(path: Path) -> PolygonSoup:
    """The polygons of an OBJ file; `SceneError` names the line that is wrong."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SceneError(f"{path}: cannot be read ({error.strerror})") from None
    try:
        return _polygons(_statements(data.removeprefix(_MARK)))
    except WrongLine as wrong:
        raise SceneError(f"{path}, {wrong}") from None


def _statements(data: bytes) -> Statements:
    """All statements of a file; raises `WrongLine`."""
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    pieces, line, so_far = list[Statements](), 1, np.zeros(2, np.int32)
    for block in _blocks(data):
        piece = read_block(block, line) or read_statements(block.decode("utf-8", errors="replace"), line)
        piece.before[:] += so_far
        pieces.append(piece)
        line += block.count(b"\n")
        so_far += len(piece.vertices), len(piece.normals)
    return joined(pieces)


def _blocks(data: bytes) -> Iterator[bytes]:
    """The file in pieces of whole lines; none ends with a line that may go on in the next one."""
    start = 0
    while start < len(data) or start == 0:
        end = start + BLOCK
        while True:
            end = data.find(b"\n", end) + 1 or len(data)
            if end == len(data) or b"\\" not in data[data.rfind(b"\n", start, end - 1) + 1 : end]:
                break
        yield data[start:end]
        start = max(end, 1)


def _polygons(said: Statements) -> PolygonSoup:
    """The polygons that the statements describe; raises `WrongLine`."""
    with np.errstate(over="ignore"):
        rounded = said.vertices.astype(np.float32)
    problem = "a vertex is not finite or leaves the range of single precision"
    _check_finite(rounded, said.vertex_lines, problem)
    _check_finite(said.normals, said.normal_lines, "a normal is not finite")
    return PolygonSoup(
        said.vertices,
        said.normals,
        _numbers(said, 0, len(said.vertices), "vertex"),
        said.sizes.astype(np.int64),
        _numbers(said, 1, len(said.normals), "normal"),
    )


def _numbers(said: Statements, column: int, count: int, what: str) -> np.ndarray:
    """(c,) the numbers of the vertices (column 0) or normals (1) of all corners, from 0; -1 where there is
    none, and (0,) where all have none. Raises `WrongLine` for one of which there are only `count`."""
    written = said.corners[:, column]
    if not written.any():
        return np.zeros(0, np.int64)
    numbers = written.astype(np.int64) - 1
    counts_back = np.flatnonzero(written < 0)
    if len(counts_back):
        numbers[counts_back] = written[counts_back] + said.before[:, column].repeat(said.sizes)[counts_back]
    wrong = numbers >= count
    wrong[counts_back] |= numbers[counts_back] < 0
    if wrong.any():
        place = int(np.argmax(wrong))
        face = int(np.searchsorted(np.cumsum(said.sizes), place, side="right"))
        problem = f"{what} {written[place]} does not exist"
        if written[place] > 0:
            problem = f"face {face} names {what} {numbers[place]}, counted from 0; the file has {count}"
        raise WrongLine(int(said.face_lines[face]), problem)
    return numbers


def _check_finite(points: np.ndarray, lines: np.ndarray, problem: str) -> None:
    finite = np.isfinite(points).all(axis=1)
    if not finite.all():
        raise WrongLine(int(lines[np.argmin(finite)]), problem)
