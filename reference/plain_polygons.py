"""Polygons for `reference.plain`, cut into triangles by the rule of the document's section 5.

Everything is decided with fractions, on corners rounded to single precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

Point = tuple[float, float, float]
Flat = tuple[Fraction, Fraction]
Corners = tuple[int, int, int]


@dataclass(frozen=True)
class MeshFile:
    """Positions, triangles as vertex numbers, and three normals a triangle (None unless the file has all);
    `places`: for vertices without numbers the first one at the same place."""

    vertices: Sequence[Point]
    triangles: Sequence[Corners]
    corner_normals: Sequence[tuple[Point, Point, Point]] | None = None
    places: Sequence[int] | None = None


def cut_polygons(
    vertices: Sequence[Point],
    polygons: Sequence[Sequence[int]],
    corner_normals: Sequence[Sequence[Point]] | None = None,
) -> MeshFile:
    """The triangles of all polygons, in file order."""
    cuts = [cut([vertices[k] for k in polygon]) for polygon in polygons]
    triangles = [(p[i], p[j], p[k]) for p, its_cut in zip(polygons, cuts, strict=True) for i, j, k in its_cut]
    if corner_normals is None:
        return MeshFile(vertices, triangles)
    pairs = zip(corner_normals, cuts, strict=True)
    return MeshFile(vertices, triangles, [(n[i], n[j], n[k]) for n, its_cut in pairs for i, j, k in its_cut])


def cut(polygon: Sequence[Point]) -> list[Corners]:
    """Triangles as places in the polygon: (0, 1, 2), (0, 2, 3), ... if these all turn as the polygon does."""
    fan = [(0, k, k + 1) for k in range(1, len(polygon) - 1)]
    corners = seen_from_the_front(polygon) if len(fan) > 1 else None
    if corners is None or all(doubled_area(corners, triangle) > 0 for triangle in fan):
        return fan
    return cut_ears(corners)


def seen_from_the_front(polygon: Sequence[Point]) -> list[Flat] | None:
    """The polygon without the coordinate in which its normal is largest; None where it has no area."""
    with np.errstate(over="ignore"):
        rounded = [[Fraction(float(np.float32(x))) for x in point] for point in polygon]
    views = [
        [(p[1], p[2]) for p in rounded],
        [(p[2], p[0]) for p in rounded],
        [(p[0], p[1]) for p in rounded],
    ]
    normal = [view_area(view) for view in views]
    largest = max(abs(component) for component in normal)
    dropped = [abs(component) for component in normal].index(largest)
    if largest == 0:
        return None
    return views[dropped] if normal[dropped] > 0 else [(y, x) for x, y in views[dropped]]


def view_area(view: list[Flat]) -> Fraction:
    """Twice the area of a flat polygon, negative where it is seen from behind."""
    sides = zip(view, view[1:] + view[:1], strict=True)
    return sum((x * v - u * y for (x, y), (u, v) in sides), Fraction(0))


def cut_ears(corners: list[Flat]) -> list[Corners]:
    """Corners are cut off in turn, from number 1 on; what cannot be cut so becomes a fan."""
    ring = [*range(1, len(corners)), 0]  # the corner in question first, the one before it last
    triangles: list[Corners] = []
    tried = 0
    while len(ring) > 3 and tried < len(ring):
        ear = (ring[-1], ring[0], ring[1])
        if is_ear(corners, ear, ring):
            triangles.append(ear)
            ring = ring[1:-1] + ring[-1:]
            tried = 0
        else:
            ring = ring[1:] + ring[:1]
            tried += 1
    return triangles + [(ring[-1], ring[k], ring[k + 1]) for k in range(len(ring) - 2)]


def is_ear(corners: list[Flat], ear: Corners, ring: Sequence[int]) -> bool:
    """Whether a corner points outward and its triangle, edges included, holds no other corner of the ring;
    those at the same place as one of the three do not count."""
    a, b, c = ear
    own = {corners[a], corners[b], corners[c]}
    if doubled_area(corners, ear) <= 0:
        return False
    return not any(
        corners[k] not in own
        and min(doubled_area(corners, edge) for edge in ((a, b, k), (b, c, k), (c, a, k))) >= 0
        for k in ring
    )


def doubled_area(corners: list[Flat], triangle: Corners) -> Fraction:
    """Positive for a triangle that turns to the left."""
    (ax, ay), (bx, by), (cx, cy) = (corners[k] for k in triangle)
    return (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
