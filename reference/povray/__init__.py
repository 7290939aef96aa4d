"""From records of a scene to POV-Ray's terms: one function a kind, found by the record's class.

`without_adapter` names the kinds that have none; a test demands that there are none. Lights are sets of
points, as for Mitsuba (`reference.adapters`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from reference import adapters
from reference.adapters import adapter_of, points_of
from reference.povray import shapes, textures
from reference.povray.camera import perspective
from reference.povray.shapes import Surroundings
from reference.povray.text import Space
from reference.povray.textures import Ground
from tracer.camera import Camera
from tracer.canvas import Canvas
from tracer.lights import LIGHT_KINDS
from tracer.records import Record
from tracer.shapes import SHAPE_KINDS, Instance, Mesh, Plane, ShapeRecord, Sphere
from tracer.textures import TEXTURE_KINDS, AffineImage, Checker, Image, Solid, Stripes, TextureRecord

SHAPES: dict[type[ShapeRecord], Callable[[int, ShapeRecord, Surroundings], str]] = {
    Plane: shapes.plane,
    Sphere: shapes.sphere,
    Mesh: shapes.mesh,
    Instance: shapes.instance,
}

LIGHTS = adapters.LIGHTS

CAMERAS: dict[type[Record], Callable[[Canvas, Space], str]] = {Camera: perspective}

TEXTURES: dict[type[TextureRecord], Callable[[Any, Ground], str]] = {
    Solid: textures.solid,
    Stripes: textures.stripes,
    Checker: textures.checker,
    Image: textures.picture,
    AffineImage: textures.picture,
}

__all__ = ["body_of", "camera_of", "points_of", "texture_of", "without_adapter"]


def body_of(number: int, shape: ShapeRecord, around: Surroundings) -> str:
    """The shape with that number as an object without looks; raises `UsageError` for a kind without
    adapter."""
    return _adapter(SHAPES, shape)(number, shape, around)


def camera_of(camera: Camera, canvas: Canvas, space: Space) -> str:
    """The camera, with its canvas in the size wanted."""
    return _adapter(CAMERAS, camera)(canvas, space)


def texture_of(texture: TextureRecord, ground: Ground) -> str:
    """The texture with the finish of its material."""
    return _adapter(TEXTURES, texture)(texture, ground)


def without_adapter() -> list[str]:
    """The kinds of shapes, lights and textures that a scene may hold and that no adapter knows."""
    missing = [f"shape {kind}" for kind, record in SHAPE_KINDS.items() if record not in SHAPES]
    missing += [f"light {kind}" for kind, record in LIGHT_KINDS.items() if record not in LIGHTS]
    return missing + [f"texture {kind}" for kind, record in TEXTURE_KINDS.items() if record not in TEXTURES]


def _adapter(known: dict, record: Record) -> Callable:
    return adapter_of(known, record, "POV-Ray", "povray")
