"""Picks the reader of a mesh file by its extension."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from tracer.shapes.gltf import read_gltf
from tracer.shapes.obj import read_obj
from tracer.shapes.ply import read_ply
from tracer.shapes.polygons import PolygonSoup
from tracer.shapes.stl import read_stl

READERS: dict[str, Callable[[Path], PolygonSoup]] = {
    ".obj": read_obj,
    ".ply": read_ply,
    ".stl": read_stl,
    ".gltf": read_gltf,
    ".glb": read_gltf,
}
"""By the extensions of `mesh.MESH_SUFFIXES`."""


def read_polygons(path: Path) -> PolygonSoup:
    """The polygons of a mesh file, in its order; `SceneError` says what is wrong with it."""
    return READERS[path.suffix.lower()](path)
