"""All textures of a scene in Dr.Jit memory, and the color of a point.

Every kind ends in the number of an entry of one palette: solid, stripes and checker store their colors there, pictures
their texels, row by row.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from tracer.backends import Backend
from tracer.textures.affine_image import AffineImage
from tracer.textures.base import CellTexture, PictureTexture, TextureRecord
from tracer.textures.cells import CellRule, modulo
from tracer.textures.checker import Checker, checker_number
from tracer.textures.image import Image
from tracer.textures.solid import Solid
from tracer.textures.stripes import Stripes, stripe_number

STRIPES, CHECKER, PICTURE = range(3)
TRUNCATE, FLIP_V, BILINEAR = 4, 8, 16
KIND_MASK = 3

NUMBERS = 8
"""Floats of a texture: the interval, or the 2x4 matrix of a picture."""


@dataclass
class TextureTables:
    """`numbers`: 8 floats a texture; `ids`: 4 a texture (kind and flags, first palette entry, colors or width, height);
    `palette`: 4 floats a color. `flags`: all bits that occur, `kinds`: all kinds that occur (part of the structure)."""

    numbers: Any
    ids: Any
    palette: Any
    flags: int
    kinds: frozenset[int]


@dataclass
class TextureRow:
    """The texture of each of n points: `flags`, `first`, `width`, `height` (n,), matrix rows `u`, `v` (4, n)."""

    flags: Any
    first: Any
    width: Any
    height: Any
    u: Any
    v: Any

    @property
    def kind(self) -> Any:
        """One of STRIPES, CHECKER, PICTURE."""
        return self.flags & KIND_MASK

    def has(self, flag: int) -> Any:
        """Mask: the texture has that flag."""
        return (self.flags & flag) != 0

    def coordinates(self, p: Any) -> tuple[Any, Any]:
        """(u, v) of points p (3, n) on the picture, in texels."""
        u = dr.fma(self.u.x, p.x, dr.fma(self.u.y, p.y, dr.fma(self.u.z, p.z, self.u.w)))
        v = dr.fma(self.v.x, p.x, dr.fma(self.v.y, p.y, dr.fma(self.v.z, p.z, self.v.w)))
        return u, v


class TexturePacker:
    """Collects textures into tables. `decode` takes colors (n, 3) to the color space of the shading."""

    def __init__(self, literal: bool, decode: Callable[[np.ndarray], np.ndarray]) -> None:
        self._literal, self._decode = literal, decode
        self._numbers: list[np.ndarray] = []
        self._ids: list[tuple[int, int, int, int]] = []
        self._palette: list[np.ndarray] = []
        self._size = 0
        self._pictures: dict[str, tuple[int, int, int]] = {}

    def add(self, texture: TextureRecord, read: Callable[[str], np.ndarray]) -> int:
        """Adds one texture and returns its number; `read` turns a picture's file name into texels (h, w, 3)."""
        numbers = np.zeros(NUMBERS)
        if isinstance(texture, (Image, AffineImage)):
            numbers[:] = texture.texel_matrix().ravel()
            first, width, height = self._add_picture(texture.file, read)
            ids = (PICTURE | self._flags(texture), first, width, height)
        elif isinstance(texture, (Stripes, Checker)):
            kind = STRIPES if isinstance(texture, Stripes) else CHECKER
            numbers[0] = texture.interval
            colors = np.array(texture.colors)
            ids = (kind | self._flags(texture), self._add_colors(colors), len(colors), 1)
        else:
            assert isinstance(texture, Solid)
            numbers[0] = 1
            ids = (STRIPES, self._add_colors(np.array([texture.color])), 1, 1)
        self._numbers.append(numbers)
        self._ids.append(ids)
        return len(self._ids) - 1

    def tables(self, backend: Backend) -> TextureTables:
        """Uploads what was added."""
        palette = np.zeros((self._size, 4))
        palette[:, :3] = np.concatenate(self._palette)
        flags = [row[0] for row in self._ids]
        return TextureTables(
            numbers=backend.table(np.array(self._numbers)),
            ids=backend.id_table(np.array(self._ids)),
            palette=backend.table(palette),
            flags=int(np.bitwise_or.reduce(flags)),
            kinds=frozenset(flag & KIND_MASK for flag in flags),
        )

    def _flags(self, texture: CellTexture) -> int:
        truncate = texture.index == "truncate" or (texture.index is None and self._literal)
        flags = TRUNCATE if truncate else 0
        if isinstance(texture, PictureTexture):
            flip = self._literal if texture.flip_v is None else texture.flip_v
            flags |= (FLIP_V if flip else 0) | (BILINEAR if texture.filter == "bilinear" else 0)
        return flags

    def _add_colors(self, colors: np.ndarray) -> int:
        first = self._size
        self._palette.append(self._decode(colors))
        self._size += len(colors)
        return first

    def _add_picture(self, file: str, read: Callable[[str], np.ndarray]) -> tuple[int, int, int]:
        if file not in self._pictures:
            texels = read(file)
            height, width = texels.shape[:2]
            self._pictures[file] = (self._add_colors(texels.reshape(-1, 3)), width, height)
        return self._pictures[file]


def pack_textures(
    backend: Backend,
    textures: Sequence[TextureRecord],
    literal: bool,
    decode: Callable[[np.ndarray], np.ndarray],
    read: Callable[[str], np.ndarray],
) -> TextureTables:
    """Tables of textures, in their order."""
    packer = TexturePacker(literal, decode)
    for texture in textures:
        packer.add(texture, read)
    return packer.tables(backend)


def texture_row(backend: Backend, tables: TextureTables, texture: Any, active: Any) -> TextureRow:
    """Reads the rows of textures (n,)."""
    ids = dr.gather(backend.IdVector4, tables.ids, texture, active)
    u, v = (dr.gather(backend.Vector4, tables.numbers, texture * 2 + k, active) for k in range(2))
    return TextureRow(ids.x, ids.y, ids.z, ids.w, u, v)


def texture_color(backend: Backend, tables: TextureTables, row: TextureRow, p: Any, active: Any) -> Any:
    """Colors (3, n) of points p (3, n), in the color space of the shading."""
    truncate = row.has(TRUNCATE) if tables.flags & TRUNCATE else False
    rule = CellRule(backend, truncate)
    number = backend.UInt32(0)
    if STRIPES in tables.kinds:
        cell = stripe_number(rule, p, row.u.x, backend.Float(row.width))
        number = dr.select(row.kind == STRIPES, backend.UInt32(cell), number)
    if CHECKER in tables.kinds:
        cell = checker_number(rule, p, row.u.x)
        number = dr.select(row.kind == CHECKER, backend.UInt32(cell), number)
    if PICTURE not in tables.kinds:
        return _entry(backend, tables, row.first + number, active)
    u, v = row.coordinates(p)
    largest = dr.maximum(dr.abs(u), dr.abs(v))
    is_picture = active & (row.kind == PICTURE)
    texel = _texel(backend, row, rule.magnitude(rule.cell(u, largest)), rule.magnitude(rule.cell(v, largest)))
    color = _entry(backend, tables, row.first + dr.select(is_picture, texel, number), active)
    if tables.flags & BILINEAR:
        smooth = is_picture & row.has(BILINEAR)
        color = dr.select(smooth, _bilinear(backend, tables, row, u, v, smooth), color)
    return color


def _entry(backend: Backend, tables: TextureTables, index: Any, active: Any) -> Any:
    color = dr.gather(backend.Vector4, tables.palette, index, active)
    return backend.Vector3(color.x, color.y, color.z)


def _texel(backend: Backend, row: TextureRow, column: Any, line: Any) -> Any:
    """Number of a texel within its picture; both indices are tiled by a positive modulo."""
    i = backend.UInt32(modulo(column, backend.Float(row.width)))
    j = backend.UInt32(modulo(line, backend.Float(row.height)))
    upright = row.height - 1 - j
    return dr.select(row.has(FLIP_V), j, upright) * row.width + i


def _bilinear(backend: Backend, tables: TextureTables, row: TextureRow, u: Any, v: Any, active: Any) -> Any:
    """Mean of the four texels around (u, v), whose centers stand at k + 1/2."""
    i, j = dr.floor(u - 0.5), dr.floor(v - 0.5)
    fu, fv = u - 0.5 - i, v - 0.5 - j

    def at(di: int, dj: int) -> Any:
        return _entry(backend, tables, row.first + _texel(backend, row, i + di, j + dj), active)

    low = dr.fma(fu, at(1, 0), (1 - fu) * at(0, 0))
    high = dr.fma(fu, at(1, 1), (1 - fu) * at(0, 1))
    return dr.fma(fv, high, (1 - fv) * low)

