"""The shapes in POV-Ray's terms: one function a kind, each a whole object without its looks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from reference.povray.mesh2 import mesh2
from reference.povray.text import Space, number
from tracer.device_meshes import inherited
from tracer.scene import Scene
from tracer.shapes import ShapeRecord
from tracer.shapes.triangles import PlacedMesh


@dataclass(frozen=True)
class Surroundings:
    """What an adapter may ask: the `scene`, the placed `meshes` by shape number, POV-Ray's `space`."""

    scene: Scene
    meshes: Mapping[int, PlacedMesh]
    space: Space


def plane(index: int, shape: ShapeRecord, around: Surroundings) -> str:
    """The infinite plane; its inside is where the normal does not point."""
    row = shape.placed_coefficients()  # type: ignore[attr-defined]
    return f"plane {{ {around.space.direction(row[:3])}, {around.space.length(-row[3])} }}"


def sphere(index: int, shape: ShapeRecord, around: Surroundings) -> str:
    """The sphere."""
    row = shape.placed_coefficients()  # type: ignore[attr-defined]
    return f"sphere {{ {around.space.point(row[:3])}, {number(around.space.unit * row[3])} }}"


def mesh(index: int, shape: ShapeRecord, around: Surroundings) -> str:
    """The triangles but for the degenerate ones, which the tracer never hits; empty if none is left."""
    placed = around.meshes[index]
    kept = placed.normals.any(axis=1)
    if not kept.any():
        return ""
    normals = None
    if inherited(around.scene, shape, "smooth"):
        normals = placed.corner_normals[kept]
        flat = np.broadcast_to(placed.normals[kept][:, None], normals.shape)
        normals = np.where(normals.any(axis=2, keepdims=True), normals, flat) * [1.0, 1.0, -1.0]
    return mesh2(around.space.points(placed.corners[kept]), normals)


def instance(index: int, shape: ShapeRecord, around: Surroundings) -> str:
    """Triangles of its own: the tracer rounds placed vertices, which a transformed mesh would not."""
    return mesh(index, shape, around)
