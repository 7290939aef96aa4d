"""How the camera moves: around a point, along the canvas, towards a point, and as the document moves it.

A camera keeps its form. Angles are in degrees, positive to the left and up, as in the scene file.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracer.camera import Camera
from tracer.canvas import Canvas
from tracer.placement import cosine_sine, turned_about

STEEPEST = 89.0  # degrees above or below the horizon that an orbit reaches: beyond, up and down change places
NEAREST = 1e-3  # share of the distance to its target within which a look-at camera never comes in one step

Vector = NDArray[np.float64]


def pivot_of(camera: Camera, depth: float) -> Vector:
    """What the camera goes around: its target, or what is seen in the middle of the picture, `depth` from
    the canvas; the canvas center where nothing is (-1)."""
    if camera.target is not None:
        return np.array(camera.target)
    canvas = Canvas.of(camera)
    return canvas.center + max(depth, 0.0) * canvas.forward


def orbited(camera: Camera, pivot: Vector, left: float, up: float) -> Camera:
    """Eye and view turned around a point, which keeps its place in the picture."""
    if camera.origin is not None and camera.target is not None:
        return _look_at_orbit(camera, left, up)
    steepest = max(STEEPEST, abs(camera.rotate[1]))
    steep = float(np.clip(camera.rotate[1] + up, -steepest, steepest))
    turned = changed(camera, rotate=(camera.rotate[0] + left, steep))
    before, after = _frame(Canvas.of(camera)), _frame(Canvas.of(turned))
    center = pivot + after @ (before.T @ (np.array(camera.position) - pivot))
    return changed(turned, position=_triple(center))


def panned(camera: Camera, pivot: Vector, right: float, down: float) -> Camera:
    """The camera moved along its canvas so that the pivot moves by a share of the picture's height."""
    canvas = Canvas.of(camera)
    away = float((pivot - canvas.eye) @ canvas.forward)
    height = canvas.height * canvas.pixel_size * max(away, canvas.distance) / canvas.distance
    return shifted(camera, _triple(-height * (right * canvas.x + down * canvas.y)))


def dollied(camera: Camera, pivot: Vector, share: float) -> Camera:
    """The camera moved by a share of its way to the pivot, backwards where that is negative."""
    share = min(share, 1 - NEAREST)
    if camera.origin is not None and camera.target is not None:
        origin, target = np.array(camera.origin), np.array(camera.target)
        return changed(camera, origin=_triple(origin + share * (target - origin)))
    canvas = Canvas.of(camera)
    return shifted(camera, _triple(share * float((pivot - canvas.eye) @ canvas.forward) * canvas.forward))


def rotated(camera: Camera, x_rotate: float, y_rotate: float) -> Camera:
    """The document's `x_rotate` and `y_rotate`: the view turned about the canvas center."""
    if camera.origin is None or camera.target is None:
        return changed(camera, rotate=(camera.rotate[0] + x_rotate, camera.rotate[1] + y_rotate))
    canvas = Canvas.of(camera)
    forward, x, y = canvas.forward, canvas.x, canvas.y
    cos, sin = cosine_sine(x_rotate)
    forward, x = cos * forward - sin * x, cos * x + sin * forward
    cos, sin = cosine_sine(y_rotate)
    forward, y = cos * forward - sin * y, cos * y + sin * forward
    origin = canvas.center - canvas.distance * forward
    reach = float(np.linalg.norm(np.subtract(camera.target, camera.origin)))
    return changed(camera, origin=_triple(origin), target=_triple(origin + reach * forward), up=_triple(-y))


def shifted(camera: Camera, by: tuple[float, float, float]) -> Camera:
    """The document's `move`: eye and canvas moved, in scene units."""
    if camera.origin is None or camera.target is None:
        return changed(camera, position=_sum(camera.position, by))
    return changed(camera, origin=_sum(camera.origin, by), target=_sum(camera.target, by))


def as_toml(camera: Camera) -> str:
    """The camera's table as it stands in a scene file, one line a key."""
    tables: dict[str, dict[str, Any]] = {"camera": camera.to_dict()}
    below = {key: value for key, value in tables["camera"].items() if isinstance(value, dict)}
    tables |= {f"camera.{key}": tables["camera"].pop(key) for key in below}
    return "\n".join(
        line
        for name, table in tables.items()
        for line in (f"[{name}]", *(f"{key} = {json.dumps(value)}" for key, value in table.items()))
    )


def changed(camera: Camera, **values: Any) -> Camera:
    """The camera with other values, checked as all are; raises `SceneError`."""
    twin = camera.model_copy()
    for key, value in values.items():
        setattr(twin, key, value)
    return twin


def on_canvas(camera: Camera, canvas: Canvas, **values: Any) -> Camera:
    """The camera with the resolution of another canvas of its own, and with other values; the framing is that
    canvas's."""
    pixel = {} if camera.is_look_at else {"pixel_size": canvas.pixel_size}
    return changed(camera, resolution=(canvas.width, canvas.height), **pixel, **values)


def _look_at_orbit(camera: Camera, left: float, up: float) -> Camera:
    assert camera.origin is not None and camera.target is not None
    axis = np.array(camera.up) / np.linalg.norm(camera.up)
    canvas = Canvas.of(camera)
    height = float(np.degrees(np.arcsin(np.clip(canvas.forward @ axis, -1, 1))))
    up = float(np.clip(height + up, -STEEPEST, STEEPEST)) - height
    arm = turned_about(np.subtract(camera.origin, camera.target), canvas.x, up)
    return changed(camera, origin=_triple(camera.target + turned_about(arm, axis, left)))


def _frame(canvas: Canvas) -> Vector:
    return np.stack([canvas.x, canvas.y, canvas.forward], axis=1)


def _sum(a: tuple[float, float, float], b: tuple[float, float, float]) -> tuple[float, float, float]:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _triple(vector: Vector) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z
