"""What Mitsuba has for the model's colors, textures and materials, as elements of a scene file.

Mitsuba's colors are linear, so display values are decoded. Its dielectric splits light by Fresnel's formulas
where the model has constants, and it has no Phong highlight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from reference.adapters.geometry import Ball, Body, Disk
from tracer.color import decode_srgb
from tracer.device_meshes import inherited, source_of
from tracer.material import Material
from tracer.scene import Scene
from tracer.shapes import ShapeRecord
from tracer.textures import Checker, PictureTexture, Solid, Stripes, TextureRecord
from tracer.textures.picture import read_picture


@dataclass(frozen=True)
class Look:
    """The color of a shape: linear `color` (3,), its mean where that is all that Mitsuba can show.

    With `uv` (2, 4), the map from (x, y, z, 1) to texture coordinates, either a `picture` or two linear
    `checks` are laid on. `is_mean`: the color stands for a texture.
    """

    color: np.ndarray
    is_mean: bool = False
    uv: np.ndarray | None = None
    picture: Path | None = None
    bilinear: bool = False
    checks: tuple[np.ndarray, np.ndarray] | None = None


def look_of(scene: Scene, shape: ShapeRecord, body: Body) -> Look:
    """The look of a shape; pictures on planes and meshes and checkers on planes along the axes are kept."""
    texture = texture_record(scene, shape)
    back = np.eye(3, 4)
    if inherited(scene, shape, "texture_space") == "object":
        back = shape.placement.inverse()
    if isinstance(texture, PictureTexture):
        return _picture(scene, texture, body, back)
    colors = [texture.color] if isinstance(texture, Solid) else texture.colors  # type: ignore[attr-defined]
    linear = decode_srgb(np.array(colors, np.float64))
    mean = linear.mean(axis=0)
    if isinstance(texture, Checker) and isinstance(body, Disk) and np.array_equal(back, np.eye(3, 4)):
        uv, parity = _checker(texture, body)
        if uv is not None:
            return Look(mean, uv=uv, checks=(linear[parity], linear[1 - parity]))
    return Look(mean, is_mean=isinstance(texture, (Checker, Stripes)))


def bsdf(scene: Scene, shape: ShapeRecord, look: Look, picture_name: str | None) -> Element:
    """The `bsdf` element of a shape; `picture_name` is the copy of its picture beside the file."""
    name = inherited(scene, shape, "material")
    material = Material() if name is None else scene.materials[name]
    transparent = material.refraction > 0
    other = _glass(material, look) if transparent else _mirror(look)
    share = min(1.0, material.reflection + material.refraction)
    diffuse = _diffuse(material, look, picture_name)
    if transparent:
        return other if share == 1 else _blend(share, _two_sided(diffuse), other)
    if share == 0:
        return _two_sided(diffuse)
    return _two_sided(other if share == 1 else _blend(share, diffuse, other))


def add(parent: Element, kind: str, name: str, value: object) -> Element:
    """Appends a value such as <float name="fov" value="40.0"/>."""
    return SubElement(parent, kind, name=name, value=str(value))


def numbers(values: Sequence[float] | np.ndarray) -> str:
    """Numbers as text, without loss."""
    return ", ".join(repr(float(value)) for value in np.ravel(values))


def texture_record(scene: Scene, shape: ShapeRecord) -> TextureRecord:
    """The texture of a shape, or of the mesh that it shares; a color is a texture, too."""
    has_own = shape.texture is not None or shape.color is not None
    source = shape if has_own else source_of(scene, shape)
    if source.texture is not None:
        return scene.textures[source.texture]
    return Solid(color=source.color or (1.0, 1.0, 1.0))


def _picture(scene: Scene, texture: PictureTexture, body: Body, back: np.ndarray) -> Look:
    file = scene.resolve(texture.file)
    pixels = read_picture(file)
    color = decode_srgb(pixels.reshape(-1, 3)).mean(axis=0)
    if isinstance(body, Ball):  # its coordinates in Mitsuba are angles
        return Look(color, is_mean=True)
    height, width = pixels.shape[:2]
    texels = texture.texel_matrix()  # type: ignore[attr-defined]
    uv = np.column_stack([texels[:, :3] @ back[:, :3], texels[:, :3] @ back[:, 3] + texels[:, 3]])
    uv /= np.array([[width], [height]])
    flipped = scene.literal if texture.flip_v is None else texture.flip_v
    if not flipped:  # in Mitsuba the first row of a picture is at v = 0
        uv[1] *= -1
    return Look(color, uv=uv, picture=file, bilinear=texture.filter == "bilinear")


def _checker(texture: Checker, disk: Disk) -> tuple[np.ndarray | None, int]:
    """Coordinates in pairs of cells on a plane along two axes, and which color its cell 0, 0 has."""
    fixed = np.flatnonzero(disk.normal)
    if len(fixed) != 1:
        return None, 0
    height = -disk.d * disk.normal[fixed[0]] / texture.interval
    uv = np.zeros((2, 4))
    uv[[0, 1], [axis for axis in range(3) if axis != fixed[0]]] = 1 / (2 * texture.interval)
    return uv, int(np.floor(height + 1e-6 * max(1.0, abs(height)))) % 2


def _diffuse(material: Material, look: Look, picture_name: str | None) -> Element:
    """A factor above 1 would reflect more than arrives, and clipped colors lose their hue: it counts as 1."""
    element = Element("bsdf", type="diffuse")
    if picture_name is not None:
        texture = SubElement(element, "texture", type="bitmap", name="reflectance")
        add(texture, "string", "filename", picture_name)
        add(texture, "string", "filter_type", "bilinear" if look.bilinear else "nearest")
    elif look.checks is not None:
        texture = SubElement(element, "texture", type="checkerboard", name="reflectance")
        for number, color in enumerate(look.checks):
            _rgb(texture, f"color{number}", min(material.diffuse, 1) * color)
    else:
        _rgb(element, "reflectance", min(material.diffuse, 1) * look.color)
    return element


def _mirror(look: Look) -> Element:
    element = Element("bsdf", type="conductor")
    add(element, "string", "material", "none")
    _rgb(element, "specular_reflectance", look.color)
    return element


def _glass(material: Material, look: Look) -> Element:
    element = Element("bsdf", type="dielectric")
    add(element, "float", "int_ior", material.ior)
    add(element, "float", "ext_ior", 1.0)
    _rgb(element, "specular_reflectance", look.color)
    _rgb(element, "specular_transmittance", look.color)
    return element


def _blend(share: float, first: Element, second: Element) -> Element:
    element = Element("bsdf", type="blendbsdf")
    add(element, "float", "weight", share)
    element.extend([first, second])
    return element


def _two_sided(inner: Element) -> Element:
    element = Element("bsdf", type="twosided")
    element.append(inner)
    return element


def _rgb(parent: Element, name: str, color: np.ndarray) -> None:
    add(parent, "rgb", name, numbers(np.clip(color, 0, 1)))
