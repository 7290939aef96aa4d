"""The size of a scene: what rounding in single precision is measured against."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from reference.adapters import points_of
from tracer.canvas import Canvas
from tracer.scene import Scene
from tracer.shapes import Plane, Sphere
from tracer.shapes.triangles import PlacedMesh


def extent_of(scene: Scene, canvas: Canvas, meshes: Mapping[int, PlacedMesh]) -> float:
    """S: the largest |coordinate| of eye, canvas, lights, spheres and meshes, and of the planes' points next
    to the origin."""
    across = canvas.pixel_size * (canvas.width * np.abs(canvas.x) + canvas.height * np.abs(canvas.y)) / 2
    sizes = [np.abs(canvas.eye).max(), (np.abs(canvas.center) + across).max()]
    sizes += [np.abs(points_of(light)).max() for light in scene.lights]
    sizes += [np.abs(mesh.corners).max() for mesh in meshes.values()]
    for shape in scene.shapes:
        if isinstance(shape, Sphere):
            row = shape.placed_coefficients()
            sizes.append(np.abs(row[:3]).max() + row[3])
        elif isinstance(shape, Plane):
            sizes.append(abs(shape.placed_coefficients()[3]))
    return float(max(sizes))
