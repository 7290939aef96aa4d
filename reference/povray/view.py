"""What lies between eye and canvas: the model does not see it, POV-Ray, whose rays start at the eye, does."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tracer.canvas import Canvas
from tracer.scene import Scene
from tracer.shapes import Plane, ShapeRecord, Sphere
from tracer.shapes.triangles import PlacedMesh

CLEAR, BEFORE, PARTLY = range(3)
"""A shape has nothing between eye and canvas, is met by no primary ray, or neither."""


def places_of(scene: Scene, canvas: Canvas, meshes: Mapping[int, PlacedMesh]) -> list[int]:
    """CLEAR, BEFORE or PARTLY for every shape."""
    return [_place(shape, canvas, meshes.get(number)) for number, shape in enumerate(scene.shapes)]


def _place(shape: ShapeRecord, canvas: Canvas, mesh: PlacedMesh | None) -> int:
    if isinstance(shape, Plane):
        return _plane(shape.placed_coefficients(), canvas)
    if isinstance(shape, Sphere):
        row = shape.placed_coefficients()
        return _body(row[None, :3], float(row[3]), canvas)
    return CLEAR if mesh is None else _body(mesh.corners.reshape(-1, 3), 0.0, canvas)


def _plane(row: np.ndarray, canvas: Canvas) -> int:
    """A plane that separates the eye from all of the canvas is crossed before any ray starts."""
    half = canvas.pixel_size / 2 * np.array([canvas.width, canvas.height])
    signs = [(i, j) for i in (-1, 1) for j in (-1, 1)]
    corners = [canvas.center + i * half[0] * canvas.x + j * half[1] * canvas.y for i, j in signs]
    eye = row[:3] @ canvas.eye + row[3]
    crossed = [(row[:3] @ corner + row[3]) * eye < 0 for corner in corners]
    return BEFORE if all(crossed) else PARTLY if any(crossed) else CLEAR


def _body(points: np.ndarray, radius: float, canvas: Canvas) -> int:
    """Balls around points against the two planes and the four sides of the view."""
    x, y, depth = ((points - canvas.eye) @ axis for axis in (canvas.x, canvas.y, canvas.forward))
    if (depth + radius).max() <= 0 or (depth - radius).min() >= canvas.distance:
        return CLEAR
    for across, pixels in ((x, canvas.width), (-x, canvas.width), (y, canvas.height), (-y, canvas.height)):
        half = pixels * canvas.pixel_size / 2
        beyond = (across * canvas.distance - depth * half) / np.hypot(canvas.distance, half)
        if (beyond - radius).min() >= 0:
            return CLEAR
    return BEFORE if (depth + radius).max() <= canvas.distance else PARTLY
