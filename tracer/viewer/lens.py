"""One pixel's tree of rays, as the page draws it: lines in the picture, and rows of text."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from tracer.canvas import Canvas
from tracer.lens import pixel_tree
from tracer.ray_tree import RayNode
from tracer.scene import Scene

MOST_RAYS = 400
"""Rays that are sent: the heaviest tree of 20 pending rays is readable no longer."""

BEFORE_THE_EYE = 1e-3
"""Share of the distance to the canvas below which nothing can be projected."""

MISS_LENGTH = 4.0
"""Length of a ray that hits nothing, in distances from the eye to its origin."""


def looked_at(scene: Scene, column: int, row: int, backend: str) -> dict[str, Any]:
    """The rays through the middle of a pixel of the full picture: for each its kind, level, weight, what it
    meets, what that adds to the pixel, and its line in shares of the picture's width and height, or None."""
    tree = pixel_tree(scene, column, row, backend=backend, supersample=1)
    canvas = Canvas.of(scene.camera, scene.literal)
    rays = [_described(canvas, ray) for ray, _ in zip(tree.rays(), range(MOST_RAYS), strict=False)]
    return {"x": column, "y": row, "color": tree.color.tolist(), "rays": rays}


def _described(canvas: Canvas, ray: RayNode) -> dict[str, Any]:
    return {
        "ray": ray.kind,
        "level": ray.level,
        "weight": ray.weight,
        "shape": ray.hit.name if ray.hit else None,
        "adds": ray.contribution.tolist(),
        "lights": [{"light": term.light, "share": term.share} for term in ray.lights],
        "ended": [{"ray": end.kind, "weight": end.weight, "reason": end.reason} for end in ray.ended],
        "line": _line(canvas, ray),
    }


def _line(canvas: Canvas, ray: RayNode) -> list[list[float]] | None:
    """Both ends of a ray in the picture, cut where it comes too near to the eye."""
    start = np.array(ray.origin)
    if ray.hit is not None:
        end = np.array(ray.hit.position)
    else:
        end = start + MISS_LENGTH * float(np.linalg.norm(start - canvas.eye)) * np.array(ray.direction)
    nearest = BEFORE_THE_EYE * canvas.distance
    away = [float((point - canvas.eye) @ canvas.forward) - nearest for point in (start, end)]
    if max(away) <= 0:
        return None
    if min(away) < 0:
        cut = start + away[0] / (away[0] - away[1]) * (end - start)
        start, end = (cut, end) if away[0] < 0 else (start, cut)
    return [list(_projected(canvas, point)) for point in (start, end)]


def _projected(canvas: Canvas, point: np.ndarray) -> Iterator[float]:
    arm = point - canvas.eye
    enlarged = canvas.distance / float(arm @ canvas.forward) / canvas.pixel_size
    for axis, size in ((canvas.x, canvas.width), (canvas.y, canvas.height)):
        yield 0.5 + float(arm @ axis) * enlarged / size
