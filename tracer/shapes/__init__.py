"""The shapes: one file a kind, listed in `SHAPE_KINDS`; docs/architecture.md says how to add one."""

from __future__ import annotations

from tracer.shapes.base import ShapeRecord
from tracer.shapes.instance import Instance
from tracer.shapes.mesh import Mesh
from tracer.shapes.plane import Plane
from tracer.shapes.sphere import Sphere

SHAPE_KINDS: dict[str, type[ShapeRecord]] = {
    "plane": Plane,
    "sphere": Sphere,
    "mesh": Mesh,
    "instance": Instance,
}

__all__ = ["SHAPE_KINDS", "Instance", "Mesh", "Plane", "ShapeRecord", "Sphere"]
