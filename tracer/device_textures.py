"""The textures of a scene in Dr.Jit memory, and which one each shape has."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tracer.backends import Backend
from tracer.cache import Cache, FileCache
from tracer.color import decode_srgb
from tracer.device_meshes import source_of
from tracer.records import Color
from tracer.scene import Scene
from tracer.scene.contents import contents_of
from tracer.shapes import ShapeRecord
from tracer.textures import Solid, TextureRecord
from tracer.textures.base import PictureTexture
from tracer.textures.picture import read_picture
from tracer.textures.tables import PackedTexture, TexturePacker, TextureTables


@dataclass(frozen=True, eq=False)
class _Picture:
    """Texels (h, w, 3) of a file, which stand for it where keys are compared."""

    texels: np.ndarray


@dataclass(frozen=True)
class SceneTextures:
    """The texture of each shape on the host, and the tables of all."""

    by_shape: list[PackedTexture]
    tables: TextureTables


_PICTURES: FileCache[_Picture] = FileCache(entries=32, megabytes=128)
_TABLES: Cache[SceneTextures] = Cache(entries=4, megabytes=128)


def compile_textures(scene: Scene, backend: Backend) -> SceneTextures:
    """The textures of all shapes; those that share one share its colors. Raises `SceneError` for pictures
    that cannot be used."""
    looks: dict[str | Color, TextureRecord] = {}
    names = [_look(scene, shape, looks) for shape in scene.shapes]
    files = [look.file for look in looks.values() if isinstance(look, PictureTexture)]
    pictures = {file: _PICTURES.get(scene.resolve(file), _read) for file in files}
    linear = scene.color_space == "linear"

    def make() -> SceneTextures:
        decode = decode_srgb if linear else np.asarray
        packer = TexturePacker(scene.literal, decode, lambda file: pictures[file].texels)
        packed = {name: packer.pack(look) for name, look in looks.items()}
        by_shape = [packed[name] for name in names]
        return SceneTextures(by_shape, packer.tables(backend, by_shape))

    said = tuple(map(contents_of, looks.values()))
    return _TABLES.get((backend, scene.literal, linear, tuple(names), said, *pictures.values()), make)


def _look(scene: Scene, shape: ShapeRecord, looks: dict[str | Color, TextureRecord]) -> str | Color:
    """The name or the color of a shape's texture, which is added to `looks`."""
    has_own = shape.texture is not None or shape.color is not None
    owner = shape if has_own else source_of(scene, shape)
    name = owner.texture if owner.texture is not None else owner.color or (1.0, 1.0, 1.0)
    if name not in looks:
        looks[name] = scene.textures[name] if isinstance(name, str) else Solid(color=name)
    return name


def _read(path: Path) -> tuple[_Picture, tuple[Path, ...]]:
    return _Picture(read_picture(path)), ()
