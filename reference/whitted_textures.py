"""The own color of surface points for `reference.whitted` (document, section 6)."""

from __future__ import annotations

from typing import Any

from reference.whitted_tables import (
    BILINEAR,
    CHECKER,
    FLIP_V,
    FRAME_ROWS,
    OBJECT_SPACE,
    PICTURE,
    PICTURE_ROWS,
    STRIPES,
    TRUNCATE,
    ShapeRow,
    Tables,
    affine,
    rows,
    xyz,
)
from reference.whitted_types import Array3f, Array4f, Bool, Float, UInt32, dr


def own_color(tables: Tables, row: ShapeRow, p: Array3f, active: Bool) -> Array3f:
    """C (3, n): the color of the texture at p (3, n)."""
    if tables.has(OBJECT_SPACE):
        inverse = rows(tables.frames, row.number, FRAME_ROWS, active & row.has(OBJECT_SPACE))
        p = dr.select(row.has(OBJECT_SPACE), Array3f(*(affine(line, p) for line in inverse)), p)
    entry, truncate = row.first, row.has(TRUNCATE) if tables.has(TRUNCATE) else None
    if tables.has(STRIPES | CHECKER):
        q = p * row.rate
        shift = tables.cell_shift * dr.maximum(dr.max(dr.abs(q)), 1)
        number = Float(0)
        if tables.has(STRIPES):
            number = dr.select(row.has(STRIPES), cell(q.x + q.y + q.z, shift, truncate), number)
        if tables.has(CHECKER):
            checks = sum(cell(coordinate, shift, truncate) for coordinate in q)
            number = dr.select(row.has(CHECKER), checks, number)
        entry += dr.select(row.has(STRIPES | CHECKER), modulo(number, row.count), 0)
    if not tables.has(PICTURE):
        return palette(tables, entry, active)
    is_picture = active & row.has(PICTURE)
    u_row, v_row, sizes = rows(tables.pictures, row.number, PICTURE_ROWS, is_picture)
    u, v = affine(u_row, p), affine(v_row, p)
    lines: Any = dr.reinterpret_array(UInt32, sizes.x)
    largest = dr.maximum(dr.abs(u), dr.abs(v))
    shift = tables.cell_shift * dr.maximum(largest, 1)
    texel = texel_number(row, lines, cell(u, shift, truncate), cell(v, shift, truncate))
    color = palette(tables, entry + dr.select(is_picture, texel, 0), active)
    if tables.has(BILINEAR):
        smooth = is_picture & row.has(BILINEAR)
        color = dr.select(smooth, bilinear(tables, row, lines, u, v, smooth), color)
    return color


def cell(q: Float, shift: Float, truncate: Bool | None) -> Float:
    """F(q); under the document's rule its absolute value, by which cells count there."""
    upright = dr.floor(q + shift)
    return upright if truncate is None else dr.select(truncate, dr.floor(dr.abs(q) + shift), upright)


def modulo(number: Float, count: UInt32) -> UInt32:
    """A whole number modulo `count`, never out of range however far away the point is."""
    n = Float(count)
    rest = number - n * dr.floor((number + 0.5) / n)
    return dr.select((rest >= 0) & (rest < n), UInt32(rest), 0)


def texel_number(row: ShapeRow, lines: UInt32, column: Float, line: Float) -> UInt32:
    """Number of a texel in its picture, which is tiled; lines count from the last of the file upwards."""
    i, j = modulo(column, row.count), modulo(line, lines)
    return dr.select(row.has(FLIP_V), j, lines - 1 - j) * row.count + i


def bilinear(tables: Tables, row: ShapeRow, lines: UInt32, u: Float, v: Float, active: Bool) -> Array3f:
    """The mean of the four texels around (u, v), whose centers are at k + 1/2."""
    i, j = dr.floor(u - 0.5), dr.floor(v - 0.5)
    s, t = u - 0.5 - i, v - 0.5 - j

    def texel(column: Float, line: Float) -> Array3f:
        return palette(tables, row.first + texel_number(row, lines, column, line), active)

    lower = (1 - s) * texel(i, j) + s * texel(i + 1, j)
    upper = (1 - s) * texel(i, j + 1) + s * texel(i + 1, j + 1)
    return (1 - t) * lower + t * upper


def palette(tables: Tables, entry: UInt32, active: Bool) -> Array3f:
    """Colors by their number."""
    return xyz(dr.gather(Array4f, tables.palette, entry, active))
