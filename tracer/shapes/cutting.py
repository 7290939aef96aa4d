"""Cuts polygons into triangles: fans in the order of the corners, and ears where a fan would be wrong.

Decided on exact numbers, so that the same file gives the same triangles everywhere. No library does that
here: earcut leaves out corners that lie on a straight edge, which opens gaps to the faces beyond the edge,
and it rounds. Ears: Meisters, Polygons Have Ears, 1975.
"""

from __future__ import annotations

import math

import numpy as np

LARGEST_CONCAVE = 20_000
"""Corners of a polygon that is not cut into a fan: the time grows with their square."""

OTHER_DIAGONAL = np.array([[1, 2, 3], [1, 3, 0]])
"""Corners of the two triangles of a quad that is not cut into a fan."""

Exact = tuple[int, int]  # a point of a plane, in units of the smallest single precision number


def cut_polygons(vertices: np.ndarray, corners: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """(m, 3) places among `corners`: the triangles of all polygons in order, n - 2 of one with n corners.

    `vertices` (n, 3): single precision values in float64; `corners` (k,): the vertex numbers of all polygons
    one after the other; `sizes` (f,): how many of each, three or more. ValueError where one is too large.
    """
    large = np.flatnonzero(sizes > 3)
    if not len(large):
        return np.arange(len(corners)).reshape(-1, 3)
    first = np.cumsum(sizes) - sizes
    fans = sizes - 2
    begin = np.cumsum(fans) - fans
    places = np.repeat(first, fans)[:, None] + np.zeros(3, np.int64)
    places[:, 1] += np.arange(len(places)) - np.repeat(begin, fans) + 1
    places[:, 2] = places[:, 1] + 1
    sure = _sure_fans(vertices[corners[places[np.repeat(sizes > 3, fans)]]], fans[large])
    large = large[~sure]
    quads = large[sizes[large] == 4]
    quads = quads[_sure_to_need_the_other_diagonal(vertices[corners[first[quads, None] + np.arange(4)]])]
    for k in range(2):
        places[begin[quads] + k] = first[quads, None] + OTHER_DIAGONAL[k]
    for face in np.setdiff1d(large, quads).tolist():
        start, size = first[face], sizes[face]
        cut = _cut_exactly(vertices[corners[start : start + size]])
        if cut is None:
            continue
        if size > LARGEST_CONCAVE:
            raise ValueError(
                f"face {face} has {size} corners and is not convex; allowed: {LARGEST_CONCAVE} corners"
            )
        places[begin[face] : begin[face] + size - 2] = start + np.array(_ears(*cut))
    return places


# ---- Beyond rounding, many at once -------------------------------------------------------------------------


def _sure_fans(triangles: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """(f,) whether a fan is right beyond rounding, whichever axis is dropped; `triangles` (m, 3, 3) of all
    fans, `counts` (f,) of each."""
    turns = _Turns(triangles, counts)
    return turns.on_every_axis(np.logical_and.reduceat(turns.left, turns.begin))


def _sure_to_need_the_other_diagonal(quads: np.ndarray) -> np.ndarray:
    """(q,) whether beyond rounding a fan is wrong and the cut from corner 1 to corner 3 right, for quads
    (q, 4, 3): these are the ears that `_ears` finds."""
    if not len(quads):
        return np.zeros(0, bool)
    counts = np.full(len(quads), 2)
    fan = _Turns(quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3), counts)
    other = _sure_fans(quads[:, OTHER_DIAGONAL].reshape(-1, 3, 3), counts)
    return other & fan.on_every_axis(np.logical_or.reduceat(fan.right, fan.begin))


class _Turns:
    """How the triangles (m, 3, 3) of polygons with `counts` (f,) of them turn, seen along each axis.

    `left`, `right` (m, 3): true beyond rounding, where the polygon as a whole turns left; `begin` (f,): the
    first triangle of each.
    """

    def __init__(self, triangles: np.ndarray, counts: np.ndarray) -> None:
        u, v = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
        self.begin = np.cumsum(counts) - counts
        areas, sizes = np.empty_like(u), np.empty_like(u)
        for axis in range(3):
            y, z = (axis + 1) % 3, (axis + 2) % 3
            p, q = u[:, y] * v[:, z], u[:, z] * v[:, y]
            areas[:, axis], sizes[:, axis] = p - q, np.abs(p) + np.abs(q)
        errors = 2.0**-50 * sizes  # of a component of an area; that of their sum follows
        total = np.add.reduceat(areas, self.begin)
        wrong = (1 + counts[:, None]) * np.add.reduceat(errors, self.begin)
        size = np.abs(total)
        self._may_be_dropped = size + wrong >= (size - wrong).max(axis=1, keepdims=True)
        self._has_a_sign = size > wrong
        signed = areas * np.sign(total).repeat(counts, axis=0)
        self.left, self.right = signed > errors, signed < -errors

    def on_every_axis(self, holds: np.ndarray) -> np.ndarray:
        """(f,) what `holds` (f, 3) says for every axis that may be dropped; those polygons have a sign."""
        return np.asarray(((holds & self._has_a_sign) | ~self._may_be_dropped).all(axis=1))


# ---- Exactly, one by one -----------------------------------------------------------------------------------


def _cut_exactly(polygon: np.ndarray) -> tuple[list[Exact], np.ndarray] | None:
    """The polygon (n, 3) seen along an axis, counterclockwise, exactly and as (n, 2) floats; None where its
    fan is right, or where it has no area at all."""
    points = [[int(math.ldexp(x, 149)) for x in point] for point in polygon.tolist()]
    seen = {axis: [(p[(axis + 1) % 3], p[(axis + 2) % 3]) for p in points] for axis in range(3)}
    areas = [
        sum(_turn(flat[0], flat[k], flat[k + 1]) for k in range(1, len(flat) - 1)) for flat in seen.values()
    ]
    axis = max(range(3), key=lambda k: abs(areas[k]))  # of equal ones the first
    if areas[axis] == 0:
        return None
    flat, columns = seen[axis], [(axis + 1) % 3, (axis + 2) % 3]
    if areas[axis] < 0:
        flat, columns = [(y, x) for x, y in flat], columns[::-1]
    if all(_turn(flat[0], flat[k], flat[k + 1]) > 0 for k in range(1, len(flat) - 1)):
        return None
    return flat, polygon[:, columns]


def _ears(points: list[Exact], rough: np.ndarray) -> list[tuple[int, int, int]]:
    """Cuts off corners, beginning with corner 1 and going round, whose triangle holds no other corner; when
    there is none, the outline crosses itself and what is left becomes a fan."""
    n = len(points)
    before, after = [n - 1, *range(n - 1)], [*range(1, n), 0]
    left = np.ones(n, bool)
    triangles, corner, refused = list[tuple[int, int, int]](), 1, 0
    while len(triangles) < n - 3 and refused < n - len(triangles):
        ear = before[corner], corner, after[corner]
        corner = ear[2]
        if not _is_ear(points, rough, left, ear):
            refused += 1
            continue
        triangles.append(ear)
        left[ear[1]] = False
        after[ear[0]], before[ear[2]] = ear[2], ear[0]
        refused = 0
    first, middle = before[corner], corner
    while after[middle] != first:
        triangles.append((first, middle, after[middle]))
        middle = after[middle]
    return triangles


def _is_ear(points: list[Exact], rough: np.ndarray, left: np.ndarray, ear: tuple[int, int, int]) -> bool:
    """Whether a corner turns left and its triangle holds no other corner that is left, on its edges neither;
    one at the place of one of the three does not count."""
    a, b, c = (points[k] for k in ear)
    if _turn(a, b, c) <= 0:
        return False
    box = rough[list(ear)]
    near = left & (rough >= box.min(axis=0)).all(axis=1) & (rough <= box.max(axis=0)).all(axis=1)
    for k in np.flatnonzero(near).tolist():
        p = points[k]
        inside = _turn(a, b, p) >= 0 and _turn(b, c, p) >= 0 and _turn(c, a, p) >= 0
        if inside and p not in (a, b, c):
            return False
    return True


def _turn(a: Exact, b: Exact, c: Exact) -> int:
    """Positive where a, b, c turn left; twice the area of their triangle."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
