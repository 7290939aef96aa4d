"""Reads the triangles of an STL file, ascii or binary, in the file's order.

Own code, because trimesh drops what a truncated ascii file holds of its last solid without a word. Facet
normals are skipped: the order of the corners says the same. STL has no vertex numbers, each facet brings
three vertices; for smooth shading those at the same place count as one.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tracer.errors import SceneError
from tracer.shapes.polygons import PolygonSoup, triangle_sizes
from tracer.shapes.repetitions import first_at_place
from tracer.shapes.words import lines_of, short, three_floats

_HEADER = 84  # bytes: 80 of any text, 4 of the number of facets
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_STATEMENTS = ("facet", "outer", "vertex", "vertex", "vertex", "endloop", "endfacet")
_WORDS = {"facet": 5, "outer": 2, "vertex": 4, "endloop": 1, "endfacet": 1}
_TOO_LARGE = 2.0**128 - 2.0**103  # from here on numbers round to infinity in single precision
_NOT_FINITE = "is not finite or leaves the range of single precision"


def read_stl(path: Path) -> PolygonSoup:
    """The triangles of an STL file; `SceneError` says what is wrong with it."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SceneError(f"{path}: cannot be read ({error.strerror})") from None
    # Many binary files begin with "solid" too, but no text holds a zero.
    is_text = data.removeprefix(b"\xef\xbb\xbf").lstrip()[:5].lower() == b"solid" and b"\0" not in data
    vertices = _ascii(path, data) if is_text else _binary(path, data)
    corners = np.arange(len(vertices))
    sizes, places = triangle_sizes(corners), first_at_place(vertices)
    return PolygonSoup(vertices, np.zeros((0, 3)), corners, sizes, places=places)


def _binary(path: Path, data: bytes) -> np.ndarray:
    """The corners of all facets, (3 m, 3)."""
    if len(data) < _HEADER:
        problem = f"it has {len(data)} bytes, and neither `solid` nor a header of {_HEADER} bytes"
        raise SceneError(f"{path}: is damaged or no STL file ({problem})")
    count = int.from_bytes(data[80:_HEADER], "little")
    if _HEADER + count * _FACET.itemsize != len(data):
        problem = f"its header says {count} facets, which take {count * _FACET.itemsize} bytes; "
        problem += f"{len(data) - _HEADER} follow"
        raise SceneError(f"{path}: is damaged or no STL file ({problem})")
    vertices = np.frombuffer(data, _FACET, count, _HEADER)["corners"].reshape(-1, 3).astype(np.float64)
    sound = np.isfinite(vertices).all(axis=1)
    if not sound.all():
        number = int(np.argmin(sound))
        raise SceneError(f"{path}: vertex {number % 3} of facet {number // 3}, counted from 0, {_NOT_FINITE}")
    return vertices


def _ascii(path: Path, data: bytes) -> np.ndarray:
    """The corners of all facets, (3 m, 3)."""
    numbers, expected, in_solid = list[float](), 0, False
    lines = lines_of(data.decode("utf-8-sig", errors="replace"))
    line = 1
    try:
        for line, text in enumerate(lines, 1):  # noqa: B007 - the message needs it
            words = text.split()
            while words:
                keyword = words[0].lower()
                if keyword in ("solid", "endsolid"):  # a name may follow, of several words
                    if expected or in_solid == (keyword == "solid"):
                        raise ValueError(f"`{keyword}` stands where {_wanted(in_solid, expected)} is allowed")
                    in_solid = not in_solid
                    break
                if not in_solid or keyword != _STATEMENTS[expected] or len(words) < _WORDS[keyword]:
                    found = short(" ".join(words[:5]))
                    raise ValueError(f"`{found}` stands where {_wanted(in_solid, expected)} is allowed")
                if keyword == "vertex":
                    numbers += _vertex(words)
                words = words[_WORDS[keyword] :]
                expected = (expected + 1) % len(_STATEMENTS)
        if in_solid:
            raise ValueError(f"the file ends where {_wanted(in_solid, expected)} is allowed")
    except ValueError as error:
        raise SceneError(f"{path}, line {line}: {error}") from None
    return np.array(numbers, np.float32).astype(np.float64).reshape(-1, 3)


def _wanted(in_solid: bool, expected: int) -> str:
    """What may come next."""
    if not in_solid:
        return "`solid`"
    statement = _STATEMENTS[expected]
    if statement == "facet":
        return "`facet normal x y z` or `endsolid`"
    return {"outer": "`outer loop`", "vertex": "`vertex x y z`"}.get(statement, f"`{statement}`")


def _vertex(words: list[str]) -> list[float]:
    """Three numbers that single precision can hold."""
    numbers = three_floats(words)
    if not all(abs(number) < _TOO_LARGE for number in numbers):
        raise ValueError(f"a vertex {_NOT_FINITE}")
    return numbers
