"""Reads the geometry of a Wavefront OBJ file: `v`, `vn` and `f`, in the file's order.

Own code, because the readers on offer either regroup faces or have no wheel for every Python version that
this project supports. Materials, groups, lines and texture coordinates are skipped.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tracer.errors import SceneError
from tracer.shapes.polygons import PolygonSoup, check_faces


def read_obj(path: Path) -> PolygonSoup:
    """The polygons of an OBJ file; `SceneError` names the line that is wrong."""
    vertices: list[tuple[float, ...]] = []
    normals: list[tuple[float, ...]] = []
    faces: list[list[int]] = []
    face_normals: list[list[int]] = []
    for number, words in _lines(path):
        try:
            if words[0] == "v":
                vertices.append(_three_floats(words))
            elif words[0] == "vn":
                normals.append(_three_floats(words))
            elif words[0] == "f":
                corners = [_corner(word, len(vertices), len(normals)) for word in words[1:]]
                if len(corners) < 3:
                    raise ValueError("has fewer than three corners")
                faces.append([corner[0] for corner in corners])
                face_normals.append([corner[1] for corner in corners])
        except ValueError as error:
            raise SceneError(f"{path}, line {number}: {error}") from None
    check_faces(path, faces, len(vertices), "vertex")
    check_faces(path, face_normals, len(normals), "normal")
    shape = (-1, 3)
    return PolygonSoup(
        np.array(vertices).reshape(shape), np.array(normals).reshape(shape), faces, face_normals
    )


def _lines(path: Path) -> list[tuple[int, list[str]]]:
    """(line number, words) of every line with content; a backslash at the end continues a line."""
    try:
        text = path.read_bytes().decode("utf-8-sig", errors="replace")
    except OSError as error:
        raise SceneError(f"{path}: cannot be read ({error.strerror})") from None
    result, pending, first = [], "", 0
    for number, line in enumerate(text.splitlines(), 1):
        line = line.partition("#")[0].rstrip()
        first = number if not pending else first
        if line.endswith("\\"):
            pending += line[:-1] + " "
            continue
        words = (pending + line).split()
        pending = ""
        if words:
            result.append((first, words))
    return result


def _three_floats(words: list[str]) -> tuple[float, ...]:
    if len(words) < 4:
        raise ValueError(f"`{words[0]}` needs three numbers")
    try:
        return tuple(float(word) for word in words[1:4])
    except ValueError:
        raise ValueError(f"`{' '.join(words)}` is not three numbers") from None


def _corner(word: str, vertices: int, normals: int) -> tuple[int, int]:
    """Numbers (from 0) of vertex and normal of `v`, `v/vt`, `v//vn` or `v/vt/vn`; -1 where there is no
    normal."""
    parts = word.split("/")
    try:
        vertex = int(parts[0])
        normal = int(parts[2]) if len(parts) > 2 and parts[2] else None
    except ValueError:
        raise ValueError(f"`{word}` is no corner of a face (v, v/vt, v//vn or v/vt/vn)") from None
    return _index(vertex, vertices, "vertex"), -1 if normal is None else _index(normal, normals, "normal")


def _index(number: int, so_far: int, what: str) -> int:
    """Counts from 0; negative numbers count back from the last one read so far."""
    if number > 0:
        return number - 1
    if number == 0 or -number > so_far:
        raise ValueError(f"{what} {number} does not exist")
    return so_far + number
