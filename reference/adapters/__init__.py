"""From records of a scene to Mitsuba's terms: one function a kind, found by the record's class.

`without_adapter` names the kinds that have none; a test demands that there are none.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from reference.adapters import lights, shapes
from reference.adapters.camera import perspective
from reference.adapters.geometry import Body, Perspective
from reference.adapters.shapes import Surroundings
from tracer.camera import Camera
from tracer.canvas import Canvas
from tracer.errors import UsageError
from tracer.lights import (
    LIGHT_KINDS,
    DiskLight,
    LightRecord,
    PointLight,
    RectangleLight,
    RingLight,
    SphereLight,
)
from tracer.records import Record
from tracer.shapes import SHAPE_KINDS, Instance, Mesh, Plane, ShapeRecord, Sphere

SHAPES: dict[type[ShapeRecord], Callable[[int, ShapeRecord, Surroundings], Body]] = {
    Plane: shapes.plane,
    Sphere: shapes.sphere,
    Mesh: shapes.mesh,
    Instance: shapes.instance,
}

LIGHTS: dict[type[LightRecord], Callable[[LightRecord], np.ndarray]] = {
    PointLight: lights.point,
    RingLight: lights.ring,
    DiskLight: lights.disk,
    SphereLight: lights.sphere,
    RectangleLight: lights.rectangle,
}

CAMERAS: dict[type[Record], Callable[[Canvas, float, int], Perspective]] = {Camera: perspective}


def body_of(number: int, shape: ShapeRecord, around: Surroundings) -> Body:
    """The shape with that number in Mitsuba's terms; raises `UsageError` for a kind without adapter."""
    return adapter_of(SHAPES, shape)(number, shape, around)


def points_of(light: LightRecord) -> np.ndarray:
    """(n, 3): the points that a light consists of."""
    return adapter_of(LIGHTS, light)(light)


def sensor_of(camera: Camera, canvas: Canvas, extent: float, supersample: int = 1) -> Perspective:
    """The camera, with its canvas in the size wanted, in Mitsuba's terms."""
    return adapter_of(CAMERAS, camera)(canvas, extent, supersample)


def without_adapter() -> list[str]:
    """The kinds of shapes and lights that a scene may hold and that no adapter knows."""
    missing = [f"shape {kind}" for kind, record in SHAPE_KINDS.items() if record not in SHAPES]
    return missing + [f"light {kind}" for kind, record in LIGHT_KINDS.items() if record not in LIGHTS]


def adapter_of(known: dict, record: Record, renderer: str = "Mitsuba", room: str = "adapters") -> Callable:
    """The adapter of a record in a registry; raises `UsageError` for a kind that the room does not know."""
    adapter = known.get(type(record))
    if adapter is None:
        kind = getattr(record, "kind", type(record).__name__)
        raise UsageError(f'{renderer} has no counterpart of "{kind}": reference/{room} knows no such kind')
    return adapter
