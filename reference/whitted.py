"""The document's ray tracer around Mitsuba's ray queries: a third opinion on whole pictures.

Mitsuba (with Embree) answers every "what does this ray hit"; the rest is the document's formula, evaluated in
single precision in one symbolic Dr.Jit loop that shares no code with the shading of `tracer`. Depth of field,
a filter over the finished picture, is left out.

A secondary ray starts a little along itself, as Mitsuba knows nothing of the surface it leaves. What is
nearer than 1e-5 of the scene is therefore not met; `tracer` has no such limit.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import tracer
from reference.whitted_lights import jitter_of, opaque_vector
from reference.whitted_tables import encode_srgb
from reference.whitted_tree import Counts, trace, unit
from reference.whitted_types import Array3f, Bool, Float, UInt32, UInt64, dr
from reference.whitted_world import START, World, world_of

TILE = 8  # pixels; the lanes of one tile follow a Morton curve

Rectangle = tuple[int, int, int, int]  # x0, y0, x1, y1 in pixels, ends exclusive


@dataclass(frozen=True)
class Picture:
    """`color` (h, w, 3) float32, display-referred, not clamped; `depth` (h, w) float32, -1 blank; `counts`
    of rays by kind and of how paths ended, under the names of `tracer.Result.stats`."""

    color: np.ndarray
    depth: np.ndarray
    counts: dict[str, int]


def render(
    scene: tracer.Scene,
    supersample: int | None = None,
    crop: Rectangle | None = None,
    start: float = START,
    reach: float = 1.0,
) -> Picture:
    """The picture of a scene, or the part `crop` of it.

    Args:
        scene: from `tracer.load` or built in code; its depth of field is left out.
        supersample: n for n x n rays a pixel; None: as the scene says.
        crop: (x0, y0, x1, y1) in pixels of the full picture, end exclusive.
        start: how far along themselves secondary rays start, in sizes of coordinates.
        reach: by how much the disks that stand for planes are larger than usual. What changes with these two
            is what this reference cannot say.

    Raises: `MachineError` without Mitsuba, `SceneError` where a file cannot be used.
    """
    return Whitted(scene, supersample, crop, start, reach).render()


class Whitted:
    """A scene made ready, for one picture or for the same one again and again; parameters as for `render`."""

    def __init__(
        self,
        scene: tracer.Scene,
        supersample: int | None = None,
        crop: Rectangle | None = None,
        start: float = START,
        reach: float = 1.0,
    ) -> None:
        self.n = supersample or scene.camera.supersample
        self.rectangle = crop or (0, 0, *scene.camera.resolution)
        self.linear = scene.color_space == "linear"
        self.world = world_of(scene, self.n, start, reach)

    def varied(
        self, shift: ArrayLike = (0, 0, 0), start: float | None = None, cell_shift: float | None = None
    ) -> Whitted:
        """The same scene with canvas and eye moved, another start of secondary rays, another small value at
        the borders of texture cells."""
        twin, canvas, tables = copy(self), self.world.canvas, self.world.tables
        if cell_shift is not None:
            tables = replace(tables, cell_shift=dr.opaque(Float, cell_shift))
        moved = replace(canvas, center=canvas.center + opaque_vector(shift))
        begin = self.world.start if start is None else dr.opaque(Float, start)
        twin.world = replace(self.world, canvas=moved, tables=tables, start=begin)
        return twin

    def render(self) -> Picture:
        """The picture, with its rays counted."""
        x0, y0, x1, y1 = self.rectangle
        color, depth = Float(0), Float(-1)
        totals = {"primary": (x1 - x0) * (y1 - y0) * self.n**2}
        for number in range(self.n**2):
            lanes = trace_lanes(self.world, self.rectangle, *self._part(number), count=True)
            values, near = (in_order(found, lanes, self.rectangle) for found in (lanes.color, lanes.depth))
            dr.eval(values, near, lanes.counts)
            color, depth = color + values, nearer(depth, near)
            merge(totals, lanes.counts)
        return Picture(self._shown(color), depth.numpy().reshape(y1 - y0, x1 - x0), totals)

    def still(self) -> Picture:
        """The picture with nothing counted; from the second call on without tracing the kernel in Python."""
        x0, y0, x1, y1 = self.rectangle
        color, depth = Float(0), Float(-1)
        for number in range(self.n**2):
            values, near = frozen_picture(self.world, self.rectangle, *self._part(number))
            color, depth = color + values, nearer(depth, near)
        return Picture(self._shown(color), depth.numpy().reshape(y1 - y0, x1 - x0), {})

    def color(self) -> np.ndarray:
        """The colors alone; from the second call on without tracing the kernel in Python."""
        color = frozen_color(self.world, self.rectangle, *self._part(0))
        for number in range(1, self.n**2):
            color += frozen_color(self.world, self.rectangle, *self._part(number))
        return self._shown(color)

    def _part(self, number: int) -> tuple[UInt32, UInt32]:
        """Sub-ray `number` of n x n, as kernels take it."""
        return dr.opaque(UInt32, number), dr.opaque(UInt32, self.n)

    def _shown(self, total: Float) -> np.ndarray:
        """The mean of all sub-rays in display values."""
        x0, y0, x1, y1 = self.rectangle
        mean = total if self.n == 1 else total / self.n**2
        values = mean.numpy().reshape(y1 - y0, x1 - x0, 3)
        return encode_srgb(values).astype(np.float32) if self.linear else values


def nearer(a: Float, b: Float) -> Float:
    """The smaller depth, where -1 is farthest."""
    return dr.select((b >= 0) & ((a < 0) | (b < a)), b, a)


def merge(totals: dict[str, int], counts: Counts) -> None:
    """Adds what one launch counted; of the levels the largest."""
    for field in fields(Counts):
        value = getattr(counts, field.name)
        if field.name == "deepest_level":
            totals[field.name] = max(totals.get(field.name, 0), int(dr.max(value)[0]))
        else:
            totals[field.name] = totals.get(field.name, 0) + int(dr.sum(UInt64(value))[0])


@dataclass
class Lanes:
    """What the lanes of one launch found, and which entry of the picture each one owns, if it is `active`."""

    index: UInt32
    active: Bool
    color: Array3f
    depth: Float
    counts: Counts


def trace_lanes(world: World, rectangle: Rectangle, sub_ray: UInt32, n: UInt32, count: bool) -> Lanes:
    """Sub-ray number `sub_ray` of n x n of every pixel; not evaluated yet."""
    x0, y0, x1, y1 = rectangle
    column, row, active = pixel_of_lane(x1 - x0, y1 - y0)
    i, j = column + x0, row + y0
    canvas = world.canvas
    b = sub_ray // n
    share = dr.rcp(Float(n))
    x = Float(i) + (Float(sub_ray - b * n) + canvas.offset) * share - canvas.half_width
    y = Float(j) + (Float(b) + canvas.offset) * share - canvas.half_height
    on_canvas = x * canvas.right + y * canvas.down
    d = unit(canvas.forward + on_canvas)
    jitters = [jitter_of(light, world.seed, j * canvas.width + i, sub_ray) for light in world.lights]
    found = trace(world, canvas.center + on_canvas, d, jitters, active, count)
    return Lanes(row * (x1 - x0) + column, active, *found)


def in_order(values: Any, lanes: Lanes, rectangle: Rectangle) -> Float:
    """Values of lanes (components, n) in the order of the picture, components side by side."""
    x0, y0, x1, y1 = rectangle
    components = 1 if dr.depth_v(values) == 1 else len(values)
    picture = dr.empty(Float, components * (x1 - x0) * (y1 - y0))
    dr.scatter(picture, values, lanes.index, lanes.active, mode=dr.ReduceMode.Permute)
    return picture


@dr.freeze(state_fn=None, limit=2, warn_after=1_000_000)  # each scene has a recording of its own
def frozen_color(world: World, rectangle: Rectangle, sub_ray: UInt32, n: UInt32) -> Float:
    """The colors alone, nothing counted."""
    lanes = trace_lanes(world, rectangle, sub_ray, n, count=False)
    return in_order(lanes.color, lanes, rectangle)


@dr.freeze(state_fn=None, limit=2, warn_after=1_000_000)  # each scene has a recording of its own
def frozen_picture(world: World, rectangle: Rectangle, sub_ray: UInt32, n: UInt32) -> tuple[Float, Float]:
    """Colors and depths, nothing counted."""
    lanes = trace_lanes(world, rectangle, sub_ray, n, count=False)
    return in_order(lanes.color, lanes, rectangle), in_order(lanes.depth, lanes, rectangle)


def pixel_of_lane(width: int, height: int) -> tuple[UInt32, UInt32, Bool]:
    """Column and row of each lane, tiles of 8 x 8 along a Morton curve, and which lanes own a pixel."""
    across, down = -(-width // TILE), -(-height // TILE)
    lane = dr.arange(UInt32, across * down * TILE * TILE)
    tile, place = lane >> 6, lane & 63
    column = (tile % across) * TILE + even_bits(place)
    row = (tile // across) * TILE + even_bits(place >> 1)
    return column, row, (column < width) & (row < height)


def even_bits(place: UInt32) -> UInt32:
    """Bits 0, 2 and 4 side by side."""
    return (place & 1) | ((place >> 1) & 2) | ((place >> 2) & 4)
