"""What is allowed in a scene and yet surely not meant: shapes between eye and canvas (document, section 7).

Rays start on the canvas, so what lies between the eye and the canvas is not seen, though it casts shadows.
"""

from __future__ import annotations

import numpy as np

from tracer.canvas import Canvas
from tracer.device_meshes import source_of
from tracer.messages import dotted
from tracer.scene import Scene
from tracer.shapes import Mesh, Sphere
from tracer.shapes.triangles import MeshData, place_mesh, read_mesh

MOST_NAMED = 5


def warnings_of(scene: Scene) -> list[str]:
    """Sentences for the user, one for each thing that is allowed but probably a mistake.

    Reads the scene's mesh files; raises `SceneError` where one cannot be used.
    """
    canvas = Canvas.of(scene.camera, scene.literal)
    hidden = [number for number, extent in finite_extents(scene).items() if _is_hidden(canvas, *extent)]
    if not hidden:
        return []
    names = [f"`{dotted(('shapes', scene.shapes[number].name or number))}`" for number in hidden]
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    verb = "lies" if len(names) == 1 else "lie"
    return [
        f"{scene.name}: {', '.join(names[:MOST_NAMED])}{more} {verb} wholly between the eye and the canvas, "
        "where nothing is seen; a shorter `camera.distance` or another `camera.position` shows what is there"
    ]


def finite_extents(scene: Scene) -> dict[int, tuple[np.ndarray, float]]:
    """By number, each sphere and mesh as points (n, 3) and the radius of balls around them (meshes: 0)."""
    read: dict[int, MeshData] = {}
    extents: dict[int, tuple[np.ndarray, float]] = {}
    for number, shape in enumerate(scene.shapes):
        mesh = source_of(scene, shape)
        if isinstance(shape, Sphere):
            row = shape.placed_coefficients()
            extents[number] = row[None, :3], float(row[3])
        elif isinstance(mesh, Mesh):
            if id(mesh) not in read:
                path = None if mesh.file is None else scene.resolve(mesh.file)
                read[id(mesh)] = read_mesh(mesh, path, f"{scene.name}: shapes.{mesh.name or number}")
            extents[number] = place_mesh(read[id(mesh)], shape.placement).corners.reshape(-1, 3), 0.0
    return extents


def _is_hidden(canvas: Canvas, points: np.ndarray, radius: float) -> bool:
    """Whether balls around points lie between the planes of eye and canvas and reach into the view.

    That a body misses the pyramid of view is seen only where it lies beyond one of the four side planes.
    """
    x, y, depth = ((points - canvas.eye) @ axis for axis in (canvas.x, canvas.y, canvas.forward))
    if (depth - radius).min() <= 0 or (depth + radius).max() >= canvas.distance:
        return False
    sides = ((x, canvas.width), (-x, canvas.width), (y, canvas.height), (-y, canvas.height))
    for across, pixels in sides:
        half = pixels * canvas.pixel_size / 2
        beyond = (across * canvas.distance - depth * half) / np.hypot(canvas.distance, half)
        if (beyond - radius).min() >= 0:
            return False
    return True
