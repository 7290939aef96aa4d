"""The pose of the camera: eye, canvas, rays through pixels (document, section 7), in double precision.

The ray of a pixel starts on the canvas at P = K + x X + y Y, with x and y the offsets of the pixel from the
canvas center in scene units, and its direction is that of dis f + x X + y Y: made of offsets, since P - e
cancels all digits when the eye is close to the canvas.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from tracer.backends import Backend
from tracer.camera import Camera
from tracer.placement import cosine_sine
from tracer.ray import normalize


@dataclass(frozen=True)
class Canvas:
    """Eye and canvas. `center` K, unit vectors `x` (right), `y` (down), `forward` f = (K - e)/dis; `distance`
    dis; `width`, `height` in pixels; `pixel_size` s in scene units; `offset` delta of the ray in its pixel;
    `scale` S of this picture against the one that the scene asks for."""

    center: np.ndarray
    x: np.ndarray
    y: np.ndarray
    forward: np.ndarray
    distance: float
    width: int
    height: int
    pixel_size: float
    offset: float
    scale: float = 1.0

    @property
    def eye(self) -> np.ndarray:
        """The viewpoint e."""
        return self.center - self.distance * self.forward

    @staticmethod
    def of(camera: Camera, literal: bool = False) -> Canvas:
        """The canvas of a camera record, in either of its forms."""
        pose = _look_at_pose(camera) if camera.is_look_at else _canvas_pose(camera)
        center, x, y, forward, pixel_size = pose
        width, height = camera.resolution
        offset = camera.pixel_offset
        return Canvas(
            center=center,
            x=x,
            y=y,
            forward=forward,
            distance=camera.eye_distance,
            width=width,
            height=height,
            pixel_size=pixel_size,
            offset=(0.0 if literal else 0.5) if offset is None else offset,
        )

    def scaled(self, scale: float) -> Canvas:
        """The same picture with w' = max(1, round(w S)) columns; the pixel size makes up for it, K stays."""
        width = max(1, round(self.width * scale))
        height = max(1, round(self.height * scale))
        return replace(
            self,
            width=width,
            height=height,
            pixel_size=self.pixel_size * self.width / width,
            scale=self.scale * scale,
        )

    def resized(self, width: int, height: int) -> Canvas:
        """Another resolution; the vertical extent of the canvas stays."""
        ratio = height / self.height
        return replace(
            self, width=width, height=height, pixel_size=self.pixel_size / ratio, scale=self.scale * ratio
        )


def _canvas_pose(camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """The document's camera: start pose, rotated about K by x_rotate then y_rotate, moved to its position."""
    x, y, forward = np.array([1.0, 0, 0]), np.array([0, -1.0, 0]), np.array([0, 0, -1.0])
    cos, sin = cosine_sine(camera.rotate[0])
    forward, x = cos * forward - sin * x, cos * x + sin * forward
    cos, sin = cosine_sine(camera.rotate[1])
    forward, y = cos * forward - sin * y, cos * y + sin * forward
    return np.asarray(camera.position, np.float64), x, y, forward, camera.pixel_size


def _look_at_pose(camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """f = unit(target - origin), X = unit(f x up), Y = f x X; the pixel size follows from the field of
    view."""
    assert camera.origin is not None and camera.target is not None and camera.fov is not None
    origin = np.asarray(camera.origin, np.float64)
    forward = _unit(np.asarray(camera.target, np.float64) - origin)
    x = _unit(np.cross(forward, _unit(np.asarray(camera.up, np.float64))))
    y = np.cross(forward, x)
    height = 2 * camera.eye_distance * math.tan(math.radians(camera.fov) / 2)
    return origin + camera.eye_distance * forward, x, y, forward, height / camera.resolution[1]


def _unit(vector: np.ndarray) -> np.ndarray:
    vector = vector / np.abs(vector).max()
    return vector / np.linalg.norm(vector)


@dataclass
class DeviceCanvas:
    """A canvas in a kernel: width-1 numbers that kernels read from memory.

    `eye` e, `center` K, `x`, `y`: steps of one pixel along X and Y, `forward`: dis f, `axis`: f, `distance`:
    dis, `half_width`, `half_height` in pixels, `offset` delta.
    """

    eye: Any
    center: Any
    x: Any
    y: Any
    forward: Any
    axis: Any
    distance: Any
    half_width: Any
    half_height: Any
    offset: Any

    @staticmethod
    def of(backend: Backend, canvas: Canvas) -> DeviceCanvas:
        """Uploads a canvas; the unit of x and y is the pixel."""
        return DeviceCanvas(
            eye=backend.opaque_vector(canvas.eye),
            center=backend.opaque_vector(canvas.center),
            x=backend.opaque_vector(canvas.x * canvas.pixel_size),
            y=backend.opaque_vector(canvas.y * canvas.pixel_size),
            forward=backend.opaque_vector(canvas.forward * canvas.distance),
            axis=backend.opaque_vector(canvas.forward),
            distance=backend.opaque(canvas.distance),
            half_width=backend.opaque(canvas.width / 2),
            half_height=backend.opaque(canvas.height / 2),
            offset=backend.opaque(canvas.offset),
        )

    def ray(self, column: Any, row: Any) -> tuple[Any, Any]:
        """Origin and unit direction of the ray through a point given in pixels from the top-left corner."""
        x, y = column - self.half_width, row - self.half_height
        across = dr.fma(x, self.x, y * self.y)
        return self.center + across, normalize(self.forward + across)
