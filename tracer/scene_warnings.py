"""What is allowed in a scene and yet surely not meant: shapes between eye and canvas (document, section 7),
and triangles that are never hit (section 5).

Rays start on the canvas, so what lies between the eye and the canvas is not seen, though it casts shadows.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tracer.canvas import Canvas
from tracer.device_meshes import placed_meshes
from tracer.messages import dotted
from tracer.scene import Scene
from tracer.shapes import Mesh, Sphere
from tracer.shapes.triangles import PlacedMesh

MOST_NAMED = 5


def warnings_of(scene: Scene) -> list[str]:
    """Sentences for the user, one for each thing that is allowed but probably a mistake.

    Reads the scene's mesh files; raises `SceneError` where one cannot be used.
    """
    meshes = placed_meshes(scene)
    return [*_hidden_shapes(scene, meshes), *_idle_triangles(scene, meshes)]


def finite_extents(scene: Scene) -> dict[int, tuple[np.ndarray, float]]:
    """By number, each sphere and mesh as points (n, 3) and the radius of balls around them (meshes: 0)."""
    return _extents(scene, placed_meshes(scene))


def _extents(scene: Scene, meshes: dict[int, PlacedMesh]) -> dict[int, tuple[np.ndarray, float]]:
    extents: dict[int, tuple[np.ndarray, float]] = {}
    for number, shape in enumerate(scene.shapes):
        if isinstance(shape, Sphere):
            row = shape.placed_coefficients()
            extents[number] = row[None, :3], float(row[3])
        elif number in meshes:
            extents[number] = meshes[number].corners.reshape(-1, 3), 0.0
    return extents


def _hidden_shapes(scene: Scene, meshes: dict[int, PlacedMesh]) -> Iterator[str]:
    """One sentence for all shapes that nobody sees."""
    canvas, extents = Canvas.of(scene.camera, scene.literal), _extents(scene, meshes)
    hidden = [number for number, extent in extents.items() if _is_hidden(canvas, *extent)]
    if not hidden:
        return
    names = [_name(scene, number) for number in hidden]
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    verb = "lies" if len(names) == 1 else "lie"
    yield (
        f"{scene.name}: {', '.join(names[:MOST_NAMED])}{more} {verb} wholly between the eye and the canvas, "
        "where nothing is seen; a shorter `camera.distance` or another `camera.position` shows what is there"
    )


def _idle_triangles(scene: Scene, meshes: dict[int, PlacedMesh]) -> Iterator[str]:
    """One sentence for each mesh with triangles that are never hit; its instances are not asked."""
    for number, mesh in meshes.items():
        shape = scene.shapes[number]
        if not isinstance(shape, Mesh):
            continue
        repeats = mesh.repeated & ~mesh.degenerate
        found = [
            f"{mask.sum()} {what} (the first is {np.argmax(mask)})"
            for mask, what in ((mesh.degenerate, "without area"), (repeats, "with the corners of another"))
            if mask.any()
        ]
        if found:
            source = "" if shape.file is None else f" ({shape.file})"
            yield (
                f"{scene.name}: {_name(scene, number)}{source}, of {len(mesh.corners)} triangles, has "
                f"{' and '.join(found)}, which keep their numbers and are never hit"
            )


def _name(scene: Scene, number: int) -> str:
    return f"`{dotted(('shapes', scene.shapes[number].name or number))}`"


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
