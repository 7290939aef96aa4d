"""All textures of a scene in Dr.Jit memory, and the color of a point.

Every kind ends in the number of an entry of one palette: solid, stripes and checker store their colors there,
pictures their texels, row by row.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import drjit as dr
import numpy as np

from tracer.backends import Backend
from tracer.branches import changed_where
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


@dataclass(frozen=True)
class PackedTexture:
    """One texture on the host: `flags` (kind and options), `first` palette entry, `count` of colors (a
    picture: its columns), `lines` of a picture, cells per scene unit `rate`, 2x4 `matrix` of a picture."""

    flags: int
    first: int
    count: int
    lines: int = 1
    rate: float = 1.0
    matrix: np.ndarray | None = None


@dataclass
class TextureTables:
    """`palette`: 4 floats a color. By shape, when there are pictures: `matrices` (8 floats), `lines`.
    `flags`: all option bits that occur, `kinds`: all kinds that occur; both are part of the structure."""

    palette: Any
    matrices: Any
    lines: Any
    flags: int
    kinds: frozenset[int]


@dataclass
class TextureRow:
    """The texture of each of n points (n,): see `PackedTexture`; `shape` says where to find the rest of a
    picture."""

    flags: Any
    first: Any
    count: Any
    rate: Any
    shape: Any

    @property
    def kind(self) -> Any:
        """One of STRIPES, CHECKER, PICTURE."""
        return self.flags & KIND_MASK

    def has(self, flag: int) -> Any:
        """Mask: the texture has that flag."""
        return (self.flags & flag) != 0


class TexturePacker:
    """Collects textures and their palette. `decode` takes colors (n, 3) to the color space of the shading,
    `read` turns a picture's file name into texels (h, w, 3)."""

    def __init__(
        self,
        literal: bool,
        decode: Callable[[np.ndarray], np.ndarray],
        read: Callable[[str], np.ndarray],
    ) -> None:
        self._literal, self._decode, self._read = literal, decode, read
        self._palette: list[np.ndarray] = []
        self._size = 0
        self._pictures: dict[str, tuple[int, int, int]] = {}

    def pack(self, texture: TextureRecord) -> PackedTexture:
        """Adds the colors of one texture and says where they are."""
        if isinstance(texture, (Image, AffineImage)):
            first, width, height = self._add_picture(texture.file)
            flags = PICTURE | self._flags(texture)
            return PackedTexture(flags, first, width, height, matrix=texture.texel_matrix())
        if isinstance(texture, (Stripes, Checker)):
            kind = STRIPES if isinstance(texture, Stripes) else CHECKER
            colors = np.array(texture.colors)
            rate = 1 / texture.interval
            return PackedTexture(kind | self._flags(texture), self._add(colors), len(colors), rate=rate)
        assert isinstance(texture, Solid)
        return PackedTexture(STRIPES, self._add(np.array([texture.color])), 1)

    def tables(self, backend: Backend, by_shape: Sequence[PackedTexture]) -> TextureTables:
        """Uploads the palette, and the numbers of pictures by shape."""
        palette = np.zeros((max(1, self._size), 4))
        if self._palette:
            palette[: self._size, :3] = np.concatenate(self._palette)
        matrices = np.zeros((len(by_shape), 2, 4))
        for shape, texture in enumerate(by_shape):
            if texture.matrix is not None:
                matrices[shape] = texture.matrix
        return TextureTables(
            palette=backend.table(palette),
            matrices=backend.table(matrices) if self._pictures else None,
            lines=backend.id_table([texture.lines for texture in by_shape]) if self._pictures else None,
            flags=int(np.bitwise_or.reduce([texture.flags & ~KIND_MASK for texture in by_shape] or [0])),
            kinds=frozenset(texture.flags & KIND_MASK for texture in by_shape),
        )

    def _flags(self, texture: CellTexture) -> int:
        truncate = texture.index == "truncate" or (texture.index is None and self._literal)
        flags = TRUNCATE if truncate else 0
        if isinstance(texture, PictureTexture):
            flip = self._literal if texture.flip_v is None else texture.flip_v
            flags |= (FLIP_V if flip else 0) | (BILINEAR if texture.filter == "bilinear" else 0)
        return flags

    def _add(self, colors: np.ndarray) -> int:
        first = self._size
        self._palette.append(self._decode(colors))
        self._size += len(colors)
        return first

    def _add_picture(self, file: str) -> tuple[int, int, int]:
        if file not in self._pictures:
            texels = self._read(file)
            height, width = texels.shape[:2]
            self._pictures[file] = (self._add(texels.reshape(-1, 3)), width, height)
        return self._pictures[file]


def picture_coordinates(backend: Backend, tables: TextureTables, row: TextureRow, p: Any, active: Any) -> Any:
    """(u, v) of points p (3, n) on their pictures, in texels, (2, n)."""
    m, n = (dr.gather(backend.Vector4, tables.matrices, row.shape * 2 + k, active) for k in range(2))
    u = dr.fma(m.x, p.x, dr.fma(m.y, p.y, dr.fma(m.z, p.z, m.w)))
    v = dr.fma(n.x, p.x, dr.fma(n.y, p.y, dr.fma(n.z, p.z, n.w)))
    return backend.Vector2(u, v)


def texture_color(backend: Backend, tables: TextureTables, row: TextureRow, p: Any, active: Any) -> Any:
    """Colors (3, n) of points p (3, n), in the color space of the shading."""
    truncate = row.has(TRUNCATE) if tables.flags & TRUNCATE else False
    rule = CellRule(backend, truncate)
    cells = {
        STRIPES: lambda: stripe_number(rule, p, row.rate, backend.Float(row.count)),
        CHECKER: lambda: checker_number(rule, p, row.rate),
    }
    number = dr.zeros(backend.UInt32, dr.width(active))
    for kind, cell in cells.items():
        if kind in tables.kinds:
            of_cell = partial(lambda _, cell: backend.UInt32(cell()), cell=cell)
            number = changed_where(active & (row.kind == kind), number, of_cell, label="cell")
    if PICTURE not in tables.kinds:
        return _entry(backend, tables, row.first + number, active)
    is_picture = active & (row.kind == PICTURE)
    u, v = picture_coordinates(backend, tables, row, p, is_picture)
    lines = dr.gather(backend.UInt32, tables.lines, row.shape, is_picture)
    largest = dr.maximum(dr.abs(u), dr.abs(v))
    column, line = (rule.magnitude(rule.cell(c, largest)) for c in (u, v))
    texel = _texel(backend, row, lines, column, line)
    color = _entry(backend, tables, row.first + dr.select(is_picture, texel, number), active)
    if tables.flags & BILINEAR:
        smooth = is_picture & row.has(BILINEAR)
        color = dr.select(smooth, _bilinear(backend, tables, row, lines, u, v, smooth), color)
    return color


def _entry(backend: Backend, tables: TextureTables, index: Any, active: Any) -> Any:
    color = dr.gather(backend.Vector4, tables.palette, index, active)
    return backend.Vector3(color.x, color.y, color.z)


def _texel(backend: Backend, row: TextureRow, lines: Any, column: Any, line: Any) -> Any:
    """Number of a texel within its picture; both indices are tiled by a positive modulo."""
    i = backend.UInt32(modulo(column, backend.Float(row.count)))
    j = backend.UInt32(modulo(line, backend.Float(lines)))
    return dr.select(row.has(FLIP_V), j, lines - 1 - j) * row.count + i


def _bilinear(
    backend: Backend, tables: TextureTables, row: TextureRow, lines: Any, u: Any, v: Any, active: Any
) -> Any:
    """Mean of the four texels around (u, v), whose centers stand at k + 1/2."""
    i, j = dr.floor(u - 0.5), dr.floor(v - 0.5)
    fu, fv = u - 0.5 - i, v - 0.5 - j

    def at(di: int, dj: int) -> Any:
        return _entry(backend, tables, row.first + _texel(backend, row, lines, i + di, j + dj), active)

    low = dr.fma(fu, at(1, 0), (1 - fu) * at(0, 0))
    high = dr.fma(fu, at(1, 1), (1 - fu) * at(0, 1))
    return dr.fma(fv, high, (1 - fv) * low)
