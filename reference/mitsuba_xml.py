"""A scene as a file for the program `mitsuba`: the same geometry and camera, materials as near as they come.

The bodies are those of `reference.adapters`. What has no counterpart is said in a comment at the top of the
file.
"""

from __future__ import annotations

import math
import os
import shutil
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

import numpy as np

from reference.adapters import body_of, points_of, sensor_of
from reference.adapters.extent import extent_of
from reference.adapters.geometry import Disk, Triangles
from reference.adapters.plugins import mesh_plugin
from reference.adapters.shapes import Surroundings
from reference.exported import Exported, beside
from reference.mitsuba_elements import add_point, analytic, comment, sensor, square
from reference.mitsuba_exposure import light_strength
from reference.mitsuba_looks import Look, add, bsdf, look_of, numbers
from reference.mitsuba_remarks import remarks_of
from reference.mitsuba_variant import mitsuba
from tracer.canvas import Canvas
from tracer.color import decode_srgb
from tracer.device_meshes import placed_meshes
from tracer.scene import Scene

PICTURE_FACTOR = 30.0
"""Half the edge of the square that carries a plane's picture, in scene extents: texture coordinates in single
precision stay exact to a hundredth of a texel."""

SAMPLES = 64
MAX_DEPTH = 24


def export_mitsuba(scene: Scene, path: str | os.PathLike[str], canvas: Canvas | None = None) -> Exported:
    """Writes PATH and, beside it, its meshes (.ply) and pictures.

    Mitsuba loads the file before anything takes its name, so what is there afterwards works. Raises
    `MachineError` without Mitsuba, `SceneError` for files of the scene, `OutputError` where PATH cannot be
    written.
    """
    mi = mitsuba()
    scene.check()
    with beside(path) as (file, written):
        document = _Document(scene, canvas or Canvas.of(scene.camera, scene.literal), file, mi)
        document.write()
        document.strength = light_strength(scene, mi.load_file(str(file)))
        document.write()
        mi.load_file(str(file))
    return Exported(written[-1], written[:-1], document.remarks)


class _Document:
    """The tree of elements while it is written; meshes and pictures are written as they come up.

    `strength`: factor of all lights; `remarks`: what has no counterpart.
    """

    def __init__(self, scene: Scene, canvas: Canvas, file: Path, mi: Any) -> None:
        self._scene, self._file, self._mi = scene, file, mi
        meshes = placed_meshes(scene)
        extent = extent_of(scene, canvas, meshes)
        around = Surroundings(scene, meshes, extent)
        self._bodies = {n: body_of(n, shape, around) for n, shape in enumerate(scene.shapes)}
        self._looks = {n: look_of(scene, scene.shapes[n], body) for n, body in self._bodies.items()}
        self._extent = extent
        self._view = sensor_of(scene.camera, canvas, extent)
        self._copies: dict[Path, str] = {}
        self.strength = 1.0
        self.remarks = remarks_of(scene, list(self._looks.values()))

    def write(self) -> None:
        """Writes the file with all that belongs to it."""
        root = Element("scene", version="3.0.0")
        root.append(comment("\n".join([f"{self._scene.name}, by tracer export.", *self.remarks])))
        SubElement(root, "default", name="spp", value=str(SAMPLES))
        add(root, "boolean", "embree_use_robust_intersections", "true")
        integrator = SubElement(root, "integrator", type="path")
        add(integrator, "integer", "max_depth", MAX_DEPTH)
        add(integrator, "boolean", "hide_emitters", "true")
        root.append(sensor(self._view))
        for number in self._bodies:
            self._add_shape(root, number)
        self._add_lights(root)
        indent(root)
        ElementTree(root).write(self._file, encoding="utf-8", xml_declaration=True)

    def _add_shape(self, root: Element, number: int) -> None:
        shape, body, look = self._scene.shapes[number], self._bodies[number], self._looks[number]
        if isinstance(body, Triangles) and not len(body.corners):
            return
        if shape.name:
            root.append(comment(shape.name))
        if isinstance(body, Disk) and look.uv is not None:
            body = square(body, PICTURE_FACTOR * self._extent)
        element: Element = (
            analytic(body) if not isinstance(body, Triangles) else self._mesh(number, body, look)
        )
        element.set("id", f"shape{number}")
        picture = None if look.picture is None else self._copy(look.picture)
        element.append(bsdf(self._scene, shape, look, picture))
        root.append(element)

    def _mesh(self, number: int, body: Triangles, look: Look) -> Element:
        name = self._beside(f"{number}.ply")
        uv = None
        if look.uv is not None:
            uv = body.corners @ look.uv[:, :3].T + look.uv[:, 3]
        mesh = mesh_plugin(self._mi, name, body.corners, body.corner_normals, uv)
        mesh.write_ply(str(self._file.with_name(name)))
        element = Element("shape", type="ply")
        add(element, "string", "filename", name)
        add(element, "boolean", "face_normals", "true" if body.corner_normals is None else "false")
        return element

    def _copy(self, picture: Path) -> str:
        """The name of a copy beside the file."""
        if picture not in self._copies:
            name = self._beside(f"{len(self._copies)}-{picture.name}")
            shutil.copyfile(picture, self._file.with_name(name))
            self._copies[picture] = name
        return self._copies[picture]

    def _beside(self, ending: str) -> str:
        """The name of a piece; a $ in a value would stand for a parameter."""
        return f"{self._file.stem}-{ending}".replace("$", "_")

    def _add_lights(self, root: Element) -> None:
        """Point emitters and the ambient share, by their radiance at a distance of one extent."""
        scene = self._scene
        total = sum(light.weight for light in scene.lights) or 1.0
        for light in scene.lights:
            points = points_of(light)
            share = (1 - scene.ambient) * light.weight / (total * len(points))
            power = self.strength * share * math.pi * self._extent**2
            for point in points:
                emitter = SubElement(root, "emitter", type="point")
                add_point(emitter, "position", point)
                add(emitter, "rgb", "intensity", numbers(power * decode_srgb(np.array(light.color))))
        if scene.ambient > 0:
            emitter = SubElement(root, "emitter", type="constant")
            add(emitter, "rgb", "radiance", numbers([self.strength * scene.ambient] * 3))
