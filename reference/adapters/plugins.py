"""Bodies and sensors as objects of Mitsuba."""

from __future__ import annotations

from typing import Any

import numpy as np

from reference.adapters.geometry import Ball, Body, Disk, Perspective


def shape_plugin(mi: Any, name: str, body: Body) -> Any:
    """A body as a dict or an object for `mi.load_dict`; meshes are called `name`."""
    if isinstance(body, Ball):
        return {"type": "sphere", "center": body.center.tolist(), "radius": body.radius}
    if isinstance(body, Disk):
        return {"type": "disk", "to_world": _transform(mi, body.to_world(), body.to_object())}
    return mesh_plugin(mi, name, body.corners)


def mesh_plugin(
    mi: Any,
    name: str,
    corners: np.ndarray,
    normals: np.ndarray | None = None,
    texcoords: np.ndarray | None = None,
) -> Any:
    """Triangles (m, 3, 3) as an object that shares no vertices, flat without `normals` (m, 3, 3);
    `texcoords` (m, 3, 2)."""
    properties = mi.Properties()
    properties["face_normals"] = normals is None
    count = len(corners)
    mesh = mi.Mesh(name, 3 * count, count, properties, normals is not None, texcoords is not None)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float(corners.astype(np.float32).ravel())
    parameters["faces"] = mi.UInt32(np.arange(3 * count, dtype=np.uint32))
    if normals is not None:
        parameters["vertex_normals"] = mi.Float(normals.astype(np.float32).ravel())
    if texcoords is not None:
        parameters["vertex_texcoords"] = mi.Float(texcoords.astype(np.float32).ravel())
    parameters.update()
    return mesh


def _transform(mi: Any, matrix: np.ndarray, inverse: np.ndarray) -> Any:
    """A transform with an inverse of our own: one in single precision loses digits for large scales."""
    kind = type(mi.ScalarTransform4f().matrix)
    return mi.ScalarTransform4f(kind(matrix.astype(np.float32)), kind(inverse.T.astype(np.float32)))


def sensor_plugin(mi: Any, view: Perspective) -> Any:
    """A sensor with one box a pixel, whose samples stand in the middle of their parts."""
    return mi.load_dict(
        {
            "type": "perspective",
            "to_world": mi.ScalarTransform4f(view.to_world().astype(np.float32)),
            "fov": view.fov,
            "fov_axis": "x",
            "principal_point_offset_x": view.shift[0],
            "principal_point_offset_y": view.shift[1],
            "near_clip": view.near,
            "far_clip": view.far,
            "film": {
                "type": "hdrfilm",
                "width": view.width,
                "height": view.height,
                "pixel_format": "rgb",
                "component_format": "float32",
                "rfilter": {"type": "box"},
            },
            "sampler": {"type": "stratified", "sample_count": view.samples**2, "jitter": False},
        }
    )
