"""The shapes in Mitsuba's terms: one function a kind.

Infinite planes become large disks, not rectangles: Mitsuba's disk is solved in closed form, while its
rectangle is two triangles, whose errors grow with their size. The vertices of meshes are the single precision
numbers that the tracer itself uses.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from reference.adapters.geometry import Ball, Disk, Triangles
from tracer.device_meshes import inherited
from tracer.scene import Scene
from tracer.shapes import ShapeRecord
from tracer.shapes.triangles import PlacedMesh

DISK_FACTOR = 1e5
"""Radius of the disk that stands for a plane, in scene extents: up to 1/1e5 rad below the horizon."""

LARGEST_RADIUS = 1e18
"""The area of a disk must be finite in single precision."""


@dataclass(frozen=True)
class Surroundings:
    """What an adapter may ask: the `scene`, the placed `meshes` by shape number, the `extent` S; `reach`:
    factor of the size of disks that stand for planes."""

    scene: Scene
    meshes: Mapping[int, PlacedMesh]
    extent: float
    reach: float = 1.0


def plane(number: int, shape: ShapeRecord, around: Surroundings) -> Disk:
    """A disk of 1e5 scene extents; its front is the plane's positive side."""
    row = shape.placed_coefficients()  # type: ignore[attr-defined]
    return Disk(row[:3], float(row[3]), min(DISK_FACTOR * around.extent * around.reach, LARGEST_RADIUS))


def sphere(number: int, shape: ShapeRecord, around: Surroundings) -> Ball:
    """The sphere itself."""
    row = shape.placed_coefficients()  # type: ignore[attr-defined]
    return Ball(row[:3], float(row[3]))


def mesh(number: int, shape: ShapeRecord, around: Surroundings) -> Triangles:
    """The triangles but for the degenerate ones and for repetitions, which the tracer never hits."""
    placed = around.meshes[number]
    kept = np.flatnonzero(~(placed.degenerate | placed.repeated))
    smooth = placed.corner_normals[kept] if inherited(around.scene, shape, "smooth") else None
    return Triangles(placed.corners[kept], kept, smooth)


def instance(number: int, shape: ShapeRecord, around: Surroundings) -> Triangles:
    """Triangles of its own: the tracer rounds placed vertices, which Mitsuba's instances would not."""
    return mesh(number, shape, around)
