"""Polygons as a mesh file gives them, before they are cut into triangles."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tracer.errors import SceneError


@dataclass(frozen=True)
class PolygonSoup:
    """`vertices` (n, 3), `normals` (k, 3); `faces` and `face_normals`: for each face the numbers of its
    corners and of their normals (-1: none)."""

    vertices: np.ndarray
    normals: np.ndarray
    faces: list[list[int]]
    face_normals: list[list[int]]

    @property
    def has_all_normals(self) -> bool:
        """Whether every corner of every face has a normal: only then do the file's normals count."""
        return bool(len(self.normals)) and all(min(numbers) >= 0 for numbers in self.face_normals)


def check_faces(path: Path, faces: list[list[int]], count: int, what: str) -> None:
    """Raises `SceneError` for a number that names nothing; -1 among normals means "none"."""
    lowest = 0 if what == "vertex" else -1
    for number, face in enumerate(faces):
        if max(face) >= count or min(face) < lowest:
            wrong = max(face) if max(face) >= count else min(face)
            raise SceneError(
                f"{path}: face {number} names {what} {wrong}, counted from 0; the file has {count}"
            )
