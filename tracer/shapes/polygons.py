"""Polygons as a mesh file gives them, before they are cut into triangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TypeAlias

import numpy as np

from tracer.errors import SceneError

Polygons: TypeAlias = Sequence[Sequence[int]] | np.ndarray
"""For each face the numbers of its corners; an array (m, 3) where all faces are triangles."""


@dataclass(frozen=True)
class PolygonSoup:
    """`vertices` (n, 3), `normals` (k, 3); `faces` and `face_normals`: for each face the numbers of its
    corners and of their normals (-1: none); `places` (n,), where the file does not number its vertices: the
    first vertex at the place of each; `other_files`: what was read beside the file itself."""

    vertices: np.ndarray
    normals: np.ndarray
    faces: Polygons
    face_normals: Polygons
    places: np.ndarray | None = None
    other_files: tuple[Path, ...] = ()

    @property
    def has_all_normals(self) -> bool:
        """Whether every corner of every face has a normal: only then do the file's normals count."""
        return len(self.normals) > 0 and bool((flat(self.face_normals) >= 0).all())

    @property
    def sizes(self) -> np.ndarray:
        """(f,) the number of corners of each face."""
        if isinstance(self.faces, np.ndarray):
            return np.full(len(self.faces), 3)
        return np.fromiter(map(len, self.faces), np.int64, len(self.faces))


def flat(polygons: Polygons) -> np.ndarray:
    """(k,) the numbers of all polygons, one after the other."""
    if isinstance(polygons, np.ndarray):
        return polygons.reshape(-1)
    return np.fromiter(chain.from_iterable(polygons), np.int64)


def check_faces(path: Path, faces: Polygons, count: int) -> None:
    """Raises `SceneError` for the number of a vertex that does not exist."""
    numbers = flat(faces)
    if not ((numbers < 0) | (numbers >= count)).any():
        return
    for number, face in enumerate(faces):
        if max(face) >= count or min(face) < 0:
            wrong = max(face) if max(face) >= count else min(face)
            raise SceneError(
                f"{path}: face {number} names vertex {wrong}, counted from 0; the file has {count}"
            )
