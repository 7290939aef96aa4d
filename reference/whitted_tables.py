"""A scene as the tables that `reference.whitted` shades with: shapes, colors, triangles, frames, pictures.

The numbers come from `reference.plain`, which places shapes, decodes colors and turns normals in double
precision. Here they are rounded to single precision once and laid out in rows of four floats, which are read
as packets. Shapes stand in Mitsuba's order.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import tracer
from reference import plain
from reference.whitted_types import Array3f, Array4f, Bool, Float, UInt32, dr

STRIPES, CHECKER, PICTURE, TRUNCATE, FLIP_V, BILINEAR, OBJECT_SPACE, MESH, SMOOTH = (1 << k for k in range(9))
SHAPE_ROWS, FRAME_ROWS, PICTURE_ROWS, CORNER_ROWS = 4, 3, 3, 3


CELL_SHIFT = 1e-5  # of a point's largest coordinate in cells: the model's value in single precision


@dataclass(frozen=True)
class Tables:
    """The scene's numbers in Dr.Jit memory.

    `shapes`: 4 rows a shape, see `ShapeRow`. `palette`: a row a color. By shape, or None where no shape needs
    it: `frames`, 3 rows, from the world to the shape's own space; `pictures`, 2 rows to texels and the number
    of lines. By triangle, or None: `facets`, a row of normal and plane constant; `corners`, 3 rows of
    normals. `flags`: all bits that occur in the scene; they are part of the kernel. `cell_shift`: the small
    value at borders of texture cells, in a point's largest coordinate in cells.
    """

    shapes: Float
    palette: Float
    frames: Float | None
    pictures: Float | None
    facets: Float | None
    corners: Float | None
    flags: int
    cell_shift: Float

    def has(self, flag: int) -> bool:
        """Whether some shape has that flag."""
        return bool(self.flags & flag)


@dataclass
class ShapeRow:
    """What the tables say of the shapes of n hits."""

    number: UInt32
    place: Array4f  # plane: normal and 0; sphere: center and 1 / radius
    diffuse: Float  # (1 - a) k_a m
    specular: Float  # (1 - a) k_a h
    shininess: Float
    ior: Float
    reflection: Float
    refraction: Float
    rate: Float  # cells per scene unit
    size: Float  # plane: its constant; sphere: its radius
    first: UInt32  # of its colors in the palette
    count: UInt32  # of its colors; a picture: its columns
    flags: UInt32
    first_triangle: UInt32

    @staticmethod
    def gather(tables: Tables, number: UInt32, active: Bool) -> ShapeRow:
        """The rows of shapes by number (n,)."""
        place, phong, lobes, texture = rows(tables.shapes, number, SHAPE_ROWS, active)
        floats: Any = (phong.x, phong.y, phong.z, phong.w, lobes.x, lobes.y, lobes.z, lobes.w)
        numbers: Any = (dr.reinterpret_array(UInt32, bits) for bits in texture)
        return ShapeRow(number, place, *floats, *numbers)

    def has(self, flag: int) -> Bool:
        """Mask: the shape has that flag."""
        return (self.flags & flag) != 0


def rows(table: Float | None, number: UInt32, count: int, active: Bool) -> list[Array4f]:
    """The `count` rows of each entry of a table."""
    return [dr.gather(Array4f, table, number * count + k, active) for k in range(count)]


def affine(row: Array4f, p: Array3f) -> Float:
    """row . (p, 1)."""
    return dr.fma(row.x, p.x, dr.fma(row.y, p.y, dr.fma(row.z, p.z, row.w)))


def xyz(row: Array4f) -> Array3f:
    """The first three."""
    return Array3f(row.x, row.y, row.z)


def plain_world(scene: tracer.Scene) -> plain.World:
    """The scene as the plain version reads it; files are found as the scene finds them."""
    table = scene.to_dict()
    for entry in (*table.get("shapes", ()), *table.get("textures", {}).values()):
        if "file" in entry:
            entry["file"] = str(scene.resolve(entry["file"]))
    return plain.load(table, scene.base_dir)


def whole(*numbers: int) -> list[float]:
    """Whole numbers as floats of the same bits, to stand in a table of floats."""
    return np.array(numbers, np.uint32).view(np.float32).tolist()


class TableMaker:
    """Collects the rows of one scene.

    `world` is the scene as `plain_world` reads it, `numbers` (k,) the shape at each place in Mitsuba's order.
    """

    def __init__(self, world: plain.World, numbers: Sequence[int]) -> None:
        self._world, self._numbers = world, numbers
        self._palette: list[np.ndarray] = []
        self._colors = 0
        self._first_colors: dict[int, int] = {}
        self._facets: list[np.ndarray] = []
        self._corners: list[np.ndarray] = []
        self._triangles = 0

    def tables(self) -> Tables:
        """Everything, uploaded."""
        shapes = [self._world.shapes[number] for number in self._numbers]
        flags = [shape_flags(shape) for shape in shapes]
        entries = [self._shape(shape, bits) for shape, bits in zip(shapes, flags, strict=True)]
        occurring = int(np.bitwise_or.reduce([0, *flags]))
        return Tables(
            shapes=owned_table(entries or np.zeros((1, 4 * SHAPE_ROWS))),  # all triangles may be degenerate
            palette=owned_table(np.concatenate([*self._palette, np.zeros((1, 4))])),
            frames=owned_table([frame_rows(s) for s in shapes]) if occurring & OBJECT_SPACE else None,
            pictures=owned_table([picture_rows(s) for s in shapes]) if occurring & PICTURE else None,
            facets=owned_table(np.concatenate(self._facets)) if occurring & MESH else None,
            corners=owned_table(np.concatenate(self._corners)) if occurring & SMOOTH else None,
            flags=occurring,
            cell_shift=dr.opaque(Float, CELL_SHIFT),
        )

    def _shape(self, shape: plain.Shape, flags: int) -> list[float]:
        """`ShapeRow` without its number."""
        material, geometry = shape.material, shape.geometry
        place, size, first_triangle = [0.0, 0.0, 0.0, 0.0], 0.0, 0
        if isinstance(geometry, plain.Sphere):
            place, size = [*geometry.center, 1 / geometry.radius], geometry.radius
        elif isinstance(geometry, plain.Plane):
            place, size = [*geometry.normal, 0.0], geometry.d
        else:
            first_triangle = self._mesh(geometry)
        own = (1 - self._world.ambient) * material.absorption
        first, count = self._texture(shape.texture)
        rate = 1 / getattr(shape.texture, "interval", 1.0)
        return [
            *place,
            own * material.diffuse, own * material.specular, material.shininess, material.ior,
            material.reflection, material.refraction, rate, size,
            *whole(first, count, flags, first_triangle),
        ]  # fmt: skip

    def _texture(self, texture: plain.Texture) -> tuple[int, int]:
        """First entry in the palette, and how many colors or columns."""
        if isinstance(texture, plain.PictureTexture):
            colors: Iterable[Any] = texture.texels.reshape(-1, 3)
            count = texture.texels.shape[1]
        else:
            colors = [texture.color] if isinstance(texture, plain.Solid) else texture.colors
            count = len(colors)
        if id(texture) not in self._first_colors:
            self._first_colors[id(texture)] = self._colors
            values = np.array(colors, np.float64)
            if isinstance(texture, plain.PictureTexture) and self._world.linear:
                values = decode_srgb(values)
            self._palette.append(np.column_stack([values, np.zeros(len(values))]))
            self._colors += len(values)
        return self._first_colors[id(texture)], count

    def _mesh(self, mesh: plain.Mesh) -> int:
        """The number of its first triangle in the tables, in which degenerate ones are left out."""
        first, kept = self._triangles, np.flatnonzero(np.array(mesh.normals).any(axis=1))
        self._triangles += len(kept)
        normals = np.array(mesh.normals)[kept]
        points = np.array(mesh.vertices)[np.array(mesh.triangles)[kept, 0]]
        self._facets.append(np.column_stack([normals, -(normals * points).sum(axis=1)]))
        corners = np.zeros((len(kept), CORNER_ROWS, 4))
        if mesh.corner_normals:
            corners[:, :, :3] = np.array(mesh.corner_normals)[kept]
        self._corners.append(corners)
        return first


def shape_flags(shape: plain.Shape) -> int:
    """The bits of a shape, its texture's included; a solid is a stripe without end."""
    texture, flags = shape.texture, 0
    if isinstance(texture, plain.PictureTexture):
        flags |= PICTURE | (FLIP_V if texture.flip_v else 0) | (BILINEAR if texture.bilinear else 0)
    elif isinstance(texture, plain.Checker):
        flags |= CHECKER
    elif isinstance(texture, plain.Stripes):
        flags |= STRIPES
    if getattr(texture, "truncate", False):
        flags |= TRUNCATE
    if shape.frame is not None:
        flags |= OBJECT_SPACE
    if isinstance(shape.geometry, plain.Mesh):
        flags |= MESH | (SMOOTH if shape.geometry.corner_normals else 0)
    return flags


def frame_rows(shape: plain.Shape) -> np.ndarray:
    """(3, 4): from the world to the shape's own space; the identity for a texture of the world."""
    if shape.frame is None:
        return np.eye(3, 4)
    linear = np.array(shape.frame.rows).T / np.array(shape.frame.scale)[:, None]
    return np.column_stack([linear, -linear @ np.array(shape.frame.translation)])


def picture_rows(shape: plain.Shape) -> np.ndarray:
    """(3, 4): the two rows of (u, v) = M (p, 1), and the number of the picture's lines."""
    entry = np.zeros((PICTURE_ROWS, 4))
    if isinstance(shape.texture, plain.PictureTexture):
        axes = [plain.BLACK, *(plain.vec(axis) for axis in np.eye(3))]
        offset, *columns = (np.array(shape.texture.uv(p)) for p in axes)
        entry[:2] = np.column_stack([*(column - offset for column in columns), offset])
        entry[2, 0] = whole(shape.texture.texels.shape[0])[0]
    return entry


def decode_srgb(values: np.ndarray) -> np.ndarray:
    """Display to linear (IEC 61966-2-1)."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def encode_srgb(values: np.ndarray) -> np.ndarray:
    """Linear to display (IEC 61966-2-1)."""
    root = np.maximum(values, 0.0031308) ** (1 / 2.4)
    return np.where(values <= 0.0031308, 12.92 * values, 1.055 * root - 0.055)


def owned_table(values: Any) -> Float:
    """Numbers in memory that Dr.Jit owns and aligns: only from there gathers of rows become packet loads."""
    host = Float(np.asarray(values, np.float64).astype(np.float32).ravel())
    table = dr.empty(Float, dr.width(host))
    dr.scatter(table, host, dr.arange(UInt32, dr.width(host)))
    dr.eval(table)
    return table
