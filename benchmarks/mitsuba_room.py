"""The benchmark room read from its scene file: a Mitsuba scene for the geometry, tables for the shading.

Used by `mitsuba_whitted`. Shares nothing with the package `tracer`: the file is read with `tomllib`, and only
the kinds of `scenes/room.toml` are known (planes by coefficients, spheres, point lights, solid, checker and
stripes, the document's canvas camera).
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import drjit as dr
import mitsuba as mi
import numpy as np

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

mi.set_variant("llvm_ad_rgb")

from drjit.llvm.ad import Array3f, Float, UInt32  # noqa: E402

DISK_FACTOR = 1e5  # radius of the disk that stands for an infinite plane, in scene extents
MATERIAL = {
    "ior": 1.0,
    "reflection": 0.0,
    "refraction": 0.0,
    "diffuse": 1.0,
    "specular": 0.0,
    "shininess": 1.0,
}


@dataclass(frozen=True)
class Camera:
    """The canvas: the ray of pixel (i, j) starts at corner + i * x_step + j * y_step."""

    eye: Array3f
    corner: Array3f
    x_step: Array3f
    y_step: Array3f
    width: int
    height: int


@dataclass(frozen=True)
class Light:
    """A point light; `weight` is its share of all lights."""

    position: Array3f
    weight: Float


@dataclass(frozen=True)
class Room:
    """Everything the frame kernel reads; goes through `dr.freeze` as one argument."""

    scene: mi.Scene
    camera: Camera
    lights: list[Light]
    table: Float  # four Array4f rows a shape, see `shape_row`
    palette: Float  # colors of all textures, padded to four
    extent: float  # S: size of the scene's coordinates
    ambient: float
    cutoff: float


def parse_color(value: str | list[float]) -> list[float]:
    """RGB in [0, 1] from "#rrggbb" or three numbers."""
    if isinstance(value, str):
        return [int(value[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    return [float(v) for v in value]


def opaque_vector(v: Sequence[float] | np.ndarray) -> Array3f:
    """A vector that kernels read as data: other numbers do not need another kernel."""
    return Array3f(*(dr.opaque(Float, float(x)) for x in v))


def read_camera(record: dict[str, Any], size: int | None) -> Camera:
    """The document's canvas camera in its pose (document, section 7), at `size` pixels across if given."""
    width, height = record["resolution"]
    step = record.get("pixel_size", 1.0)
    half_x, half_y = 0.5 * width * step, 0.5 * height * step
    if size is not None:
        height = max(1, round(height * size / width))
        step, width = step * width / size, size
        half_y = 0.5 * height * step
    f, x, y = np.array([0.0, 0, -1]), np.array([1.0, 0, 0]), np.array([0.0, -1, 0])
    yaw, pitch = np.radians(record.get("rotate", [0.0, 0.0]))
    f, x = math.cos(yaw) * f - math.sin(yaw) * x, math.cos(yaw) * x + math.sin(yaw) * f
    f, y = math.cos(pitch) * f - math.sin(pitch) * y, math.cos(pitch) * y + math.sin(pitch) * f
    center = np.array(record.get("position", [0.0, 0, 0]), dtype=float)
    offset = record.get("pixel_offset", 0.5)
    corner = center + (offset * step - half_x) * x + (offset * step - half_y) * y
    eye = center - record["distance"] * f
    vectors = [opaque_vector(v) for v in (eye, corner, step * x, step * y)]
    return Camera(*vectors, width=width, height=height)


def read_lights(records: list[dict[str, Any]]) -> list[Light]:
    """The point lights with weights that add up to one."""
    total = sum(record.get("weight", 1.0) for record in records)
    return [
        Light(opaque_vector(record["position"]), dr.opaque(Float, record.get("weight", 1.0) / total))
        for record in records
    ]


def scene_extent(scene: dict[str, Any]) -> float:
    """S: the largest |coordinate| of lights, spheres and canvas center, or distance of a plane or the eye."""
    points = [light["position"] for light in scene["lights"]] + [scene["camera"].get("position", [0.0])]
    extent = max(scene["camera"]["distance"], *(abs(v) for point in points for v in point))
    for shape in scene["shapes"]:
        if shape["kind"] == "sphere":
            extent = max(extent, max(abs(v) for v in shape["center"]) + shape["radius"])
        else:
            extent = max(extent, abs(shape["coefficients"][3]))
    return extent


def plane_frame(coefficients: list[float]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Two tangents, the unit normal and a point of the plane a x + b y + c z + d = 0."""
    length = np.linalg.norm(coefficients[:3])
    normal = np.array(coefficients[:3]) / length
    helper = np.eye(3)[np.argmin(np.abs(normal))]
    u = np.cross(helper, normal)
    u /= np.linalg.norm(u)
    return u, np.cross(normal, u), normal, -coefficients[3] / length * normal


def build_scene(shapes: list[dict[str, Any]], extent: float) -> mi.Scene:
    """The shapes as a Mitsuba scene; robust Embree queries, planes as large (analytic) disks."""
    tree: dict[str, Any] = {"type": "scene", "embree_use_robust_intersections": True}
    for k, shape in enumerate(shapes):
        if shape["kind"] == "sphere":
            record = {"type": "sphere", "center": shape["center"], "radius": shape["radius"]}
        else:
            u, v, n, p = plane_frame(shape["coefficients"])
            matrix = np.eye(4)
            matrix[:3] = np.stack([u * DISK_FACTOR * extent, v * DISK_FACTOR * extent, n, p], axis=1)
            record = {"type": "disk", "to_world": mi.ScalarTransform4f(matrix)}
        tree[f"shape{k:03d}"] = record
    return mi.load_dict(tree)


def shape_row(shape: dict[str, Any], scene: dict[str, Any], palette: list[list[float]]) -> list[float]:
    """One row of the shading table (16 numbers); appends the colors of the shape's texture to the palette.

    Normals of both kinds are one formula, n = a p - b: a = 1 / radius, b = center / radius for spheres,
    a = 0, b = -n for planes.
    """
    material = MATERIAL | scene["materials"].get(shape.get("material"), {})
    if shape["kind"] == "sphere":
        a = 1 / shape["radius"]
        b = [a * v for v in shape["center"]]
    else:
        a, b = 0.0, (-plane_frame(shape["coefficients"])[2]).tolist()
    solid = {"kind": "solid", "color": shape.get("color", "#ffffff")}
    texture = scene["textures"][shape["texture"]] if "texture" in shape else solid
    colors = texture.get("colors", [texture.get("color")])
    first = len(palette)
    palette += [parse_color(color) for color in colors]
    direct = (1 - scene["ambient"]) * max(0.0, 1 - material["reflection"] - material["refraction"])
    return [
        *b, a,
        direct * material["diffuse"], direct * material["specular"], material["shininess"], material["ior"],
        material["reflection"], material["refraction"], 1 / texture.get("interval", 1.0), first,
        len(colors), float(texture["kind"] == "stripes"), 0.0, 0.0,
    ]  # fmt: skip


def owned_table(rows: list[list[float]]) -> Float:
    """The rows in memory that Dr.Jit owns and aligns, so that gathers of rows become packet loads."""
    values = Float(np.array(rows, dtype=np.float32).ravel())
    table = dr.empty(Float, dr.width(values))
    dr.scatter(table, values, dr.arange(UInt32, dr.width(values)))
    dr.eval(table)
    return table


def load_room(path: str | Path, size: int | None = None) -> Room:
    """The scene file as Mitsuba scene and tables, at `size` pixels across if given."""
    with open(path, "rb") as file:
        record = tomllib.load(file)
    extent = scene_extent(record)
    palette: list[list[float]] = []
    rows = [shape_row(shape, record, palette) for shape in record["shapes"]]
    return Room(
        scene=build_scene(record["shapes"], extent),
        camera=read_camera(record["camera"], size),
        lights=read_lights(record["lights"]),
        table=owned_table(rows),
        palette=owned_table([[*color, 0.0] for color in palette]),
        extent=extent,
        ambient=record["ambient"],
        cutoff=record["cutoff"],
    )
