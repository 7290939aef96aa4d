"""The scene description: validated records, loading, saving and the schema; no Dr.Jit arrays."""

from __future__ import annotations

from tracer.camera import Camera, DepthOfField
from tracer.lights import DiskLight, LightRecord, PointLight, RectangleLight, RingLight, SphereLight
from tracer.material import Material
from tracer.records import Record
from tracer.scene.description import Scene
from tracer.scene.loading import find_scene, load
from tracer.scene.schema import json_schema
from tracer.shapes import Instance, Mesh, Plane, ShapeRecord, Sphere
from tracer.textures import AffineImage, Checker, Image, Solid, Stripes, TextureRecord

__all__ = [
    "AffineImage",
    "Camera",
    "Checker",
    "DepthOfField",
    "DiskLight",
    "Image",
    "Instance",
    "LightRecord",
    "Material",
    "Mesh",
    "Plane",
    "PointLight",
    "Record",
    "RectangleLight",
    "RingLight",
    "Scene",
    "ShapeRecord",
    "Solid",
    "Sphere",
    "SphereLight",
    "Stripes",
    "TextureRecord",
    "find_scene",
    "json_schema",
    "load",
]
