"""Polygons as a mesh file gives them, before they are cut into triangles."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tracer.errors import SceneError

_NO_NUMBERS = np.zeros(0, np.int64)


@dataclass(frozen=True)
class PolygonSoup:
    """`vertices` (n, 3), `normals` (k, 3); `sizes` (f,): the corners of each face, `corners` (c,): the vertex
    numbers of all faces, one after the other, `corner_normals` (c,): those of their normals (-1: none), or
    (0,); `places` (n,), where the file does not number its vertices: the first vertex at the place of each;
    `other_files`: what was read beside the file itself."""

    vertices: np.ndarray
    normals: np.ndarray
    corners: np.ndarray
    sizes: np.ndarray
    corner_normals: np.ndarray = field(default_factory=_NO_NUMBERS.copy)
    places: np.ndarray | None = None
    other_files: tuple[Path, ...] = ()

    @property
    def has_all_normals(self) -> bool:
        """Whether every corner of every face has a normal: only then do the file's normals count."""
        has_some = len(self.normals) > 0 and len(self.corner_normals) == len(self.corners)
        return has_some and bool((self.corner_normals >= 0).all())


def triangle_sizes(corners: np.ndarray) -> np.ndarray:
    """(f,) the sizes of faces that are all triangles, `corners` (3 f,)."""
    return np.full(len(corners) // 3, 3)


def check_faces(path: Path, corners: np.ndarray, sizes: np.ndarray, count: int) -> None:
    """Raises `SceneError` for the number of a vertex that does not exist."""
    wrong = (corners < 0) | (corners >= count)
    if not wrong.any():
        return
    ends = np.cumsum(sizes)
    face = int(np.searchsorted(ends, np.argmax(wrong), side="right"))
    own = corners[ends[face] - sizes[face] : ends[face]]
    number = own.max() if own.max() >= count else own.min()
    raise SceneError(f"{path}: face {face} names vertex {number}, counted from 0; the file has {count}")
