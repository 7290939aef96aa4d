"""A scene as a file for POV-Ray 3.7: the same geometry, camera and lights, materials as near as they come.

What has no counterpart is said in a comment at the top of the file.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from reference.adapters.extent import extent_of
from reference.exported import Exported, beside
from reference.mitsuba_looks import texture_record
from reference.povray import body_of, camera_of, points_of, texture_of
from reference.povray.finish import Finish
from reference.povray.remarks import MOST_LEVELS, remarks_of
from reference.povray.shapes import Surroundings
from reference.povray.text import Space, number, vector
from reference.povray.textures import Ground
from reference.povray.view import BEFORE, places_of
from tracer.canvas import Canvas
from tracer.color import decode_srgb
from tracer.device_meshes import inherited, placed_meshes
from tracer.material import Material
from tracer.scene import Scene
from tracer.shapes import ShapeRecord
from tracer.textures.picture import read_picture


def export_povray(scene: Scene, path: str | os.PathLike[str], canvas: Canvas | None = None) -> Exported:
    """Writes PATH and, beside it, its pictures (.png).

    Raises `SceneError` for files of the scene, `OutputError` where PATH cannot be written.
    """
    scene.check()
    with beside(path) as (file, written):
        document = _Document(scene, canvas or Canvas.of(scene.camera, scene.literal), file)
        with file.open("w", encoding="utf-8", newline="\n") as stream:
            stream.writelines(f"{part}\n" for part in document.parts())
    return Exported(written[-1], written[:-1], document.remarks)


class _Document:
    """The parts of the file; pictures are written as they come up. `remarks`: what has no counterpart."""

    def __init__(self, scene: Scene, canvas: Canvas, file: Path) -> None:
        self._scene, self._canvas, self._file = scene, canvas, file
        meshes = placed_meshes(scene)
        self._extent = extent_of(scene, canvas, meshes)
        self._space = Space.of(self._extent)
        self._around = Surroundings(scene, meshes, self._space)
        self._places = places_of(scene, canvas, meshes)
        self._copies: dict[str, tuple[str, np.ndarray]] = {}
        self._is_linear = scene.color_space == "linear"
        self.remarks = remarks_of(scene, self._places)

    def parts(self) -> Iterator[str]:
        """Head, settings, camera, lights, looks, shapes."""
        yield from self._head()
        yield from self._settings()
        yield camera_of(self._scene.camera, self._canvas, self._space)
        yield from self._lights()
        for index, shape in enumerate(self._scene.shapes):
            yield f"#declare Look{index} = {self._look(shape)}"
        for index, shape in enumerate(self._scene.shapes):
            yield from self._shape(index, shape)

    def _head(self) -> Iterator[str]:
        width, height, n = self._canvas.width, self._canvas.height, self._scene.camera.supersample
        samples = f"+AM1 +A0.0 +R{n} -J" if n > 1 else "-A"
        yield f"// {_line(self._scene.name)}, by tracer export."
        yield f'//   povray "+I{_line(self._file.name)}" +W{width} +H{height} {samples}'
        yield from (f"// {_line(remark)}" for remark in self.remarks)
        yield f"// z is mirrored; a scene unit is {number(self._space.unit)} here."

    def _settings(self) -> Iterator[str]:
        """Display values are computed with and stored as they are when both gammas are the same curve."""
        gamma = "1.0" if self._is_linear else "srgb"
        levels = min(self._scene.max_depth + 1, MOST_LEVELS)
        yield "#version 3.7;"
        yield (
            f"global_settings {{ assumed_gamma {gamma} max_trace_level {levels} "
            f"adc_bailout {number(self._scene.cutoff)} ambient_light rgb 1 }}"
        )
        yield f"background {{ rgb {vector(self._decode(np.array(self._scene.background)))} }}"

    def _lights(self) -> Iterator[str]:
        """A light source without fall-off for each point."""
        total = sum(light.weight for light in self._scene.lights)
        for light in self._scene.lights:
            points = points_of(light)
            color = self._decode(np.array(light.color)) * (light.weight / (total or 1) / len(points))
            if light.weight > 0:
                for point in points:
                    yield f"light_source {{ {self._space.point(point)} rgb {vector(color)} }}"

    def _look(self, shape: ShapeRecord) -> str:
        back = np.eye(4)
        if inherited(self._scene, shape, "texture_space") == "object":
            back[:3] = shape.placement.inverse()
        ground = Ground(
            finish=Finish(self._material(shape), self._scene.ambient),
            space=self._space,
            extent=self._extent,
            back=back,
            decode=self._decode,
            copy=self._copy,
            literal=self._scene.literal,
        )
        return texture_of(texture_record(self._scene, shape), ground)

    def _shape(self, index: int, shape: ShapeRecord) -> Iterator[str]:
        body = body_of(index, shape, self._around)
        if not body:
            return
        material = self._material(shape)
        flags = " no_image" if self._places[index] == BEFORE else ""
        if shape.name:
            yield f"// {_line(shape.name)}"
        yield f"#declare Body{index} = {body}"
        if material.refraction == 0:
            yield f"object {{ Body{index} texture {{ Look{index} }}{flags} }}"
            return
        # The shade first: of all that is around the eye, the last is what its rays leave.
        inside = f" interior {{ ior {number(material.ior)} }}"
        yield f"object {{ Body{index} {self._shade(material)} no_image no_reflection }}"
        yield f"object {{ Body{index} texture {{ Look{index} }}{inside} no_shadow{flags} }}"

    def _shade(self, material: Material) -> str:
        """What casts the shadow of glass: POV-Ray's own is filtered by the color, the model's is not."""
        through = material.refraction if self._scene.transparent_shadows else 0.0
        return f"pigment {{ rgb 0 transmit {number(through)} }} finish {{ ambient 0 diffuse 0 }}"

    def _material(self, shape: ShapeRecord) -> Material:
        name = inherited(self._scene, shape, "material")
        return Material() if name is None else self._scene.materials[name]

    def _decode(self, colors: np.ndarray) -> np.ndarray:
        """Display values as the scene computes with them."""
        return decode_srgb(colors) if self._is_linear else colors

    def _copy(self, file: str) -> tuple[str, np.ndarray]:
        """A copy beside the file: as the model, it has no alpha, no profile and no curve of its own."""
        if file not in self._copies:
            source = self._scene.resolve(file)
            texels = read_picture(source)
            name = f"{self._file.stem}-{len(self._copies)}-{source.stem}.png".replace('"', "_")
            deep = not np.array_equal(np.rint(texels * 255) / 255, texels)
            stored = (
                np.rint(texels * 65535).astype(np.uint16) if deep else np.rint(texels * 255).astype(np.uint8)
            )
            data = cv2.imencode(".png", np.ascontiguousarray(stored[..., ::-1]))[1]
            self._file.with_name(name).write_bytes(data.tobytes())
            self._copies[file] = name, texels
        return self._copies[file]


def _line(text: str) -> str:
    """One line: what follows a line break would no longer be a comment."""
    return " ".join(text.split())
