"""The materials of shapes, as the scene file gives them."""

from __future__ import annotations

import tracer
from tracer.material import Material
from tracer.shapes import Instance


def material_of(scene: tracer.Scene, number: int) -> Material:
    """The material of a shape; an instance without one has that of its mesh."""
    shape = scene.shapes[number]
    if shape.material is None and isinstance(shape, Instance):
        return material_of(scene, next(k for k, other in enumerate(scene.shapes) if other.name == shape.of))
    return scene.materials[shape.material] if shape.material is not None else Material()
