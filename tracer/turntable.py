"""The camera's way once around a scene, in the form that the camera has."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tracer.errors import SceneError
from tracer.placement import turned_about
from tracer.scene import Scene
from tracer.scene_warnings import finite_extents

Point = tuple[float, float, float]


def middle_of(scene: Scene) -> Point:
    """What a turntable goes around: the target of a look-at camera, for the canvas form the middle of the box
    around spheres and meshes. Raises `SceneError` where there is neither."""
    if scene.camera.target is not None:
        return scene.camera.target
    extents = finite_extents(scene).values()
    if not extents:
        raise SceneError(
            f"{scene.name}: has no sphere and no mesh, so there is no middle to go around; --around names one"
        )
    low = np.min([points.min(axis=0) - radius for points, radius in extents], axis=0)
    high = np.max([points.max(axis=0) + radius for points, radius in extents], axis=0)
    x, y, z = ((low + high) / 2).tolist()
    return x, y, z


def turned(scene: Scene, degrees: float, around: Point) -> Scene:
    """The scene seen from a camera that went around a point, to the right of what it looks at first.

    The axis is the camera's `up` in the look-at form, else the y axis. The camera keeps its form.
    """
    if degrees == 0:
        return scene
    camera, middle = scene.camera, np.array(around)

    def moved(point: Point, axis: NDArray) -> Point:
        x, y, z = (middle + turned_about(np.array(point) - middle, axis, degrees)).tolist()
        return x, y, z

    pose: dict[str, object]
    if camera.origin is not None and camera.target is not None:
        axis = np.array(camera.up) / np.linalg.norm(camera.up)
        pose = {"origin": moved(camera.origin, axis), "target": moved(camera.target, axis)}
    else:
        pose = {
            "position": moved(camera.position, np.array([0.0, 1.0, 0.0])),
            "rotate": (camera.rotate[0] + degrees, camera.rotate[1]),
        }
    return scene.model_copy(update={"camera": camera.model_copy(update=pose)})
