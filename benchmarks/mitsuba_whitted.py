"""The document's ray tracer as a loop around Mitsuba 3's ray queries: the peer of the speed comparison.

Mitsuba (with Embree) answers every "what does this ray hit"; the rest is shading by the document's formula
(document, sections 2 to 6) inside one symbolic Dr.Jit loop. Each pixel is one lane and traces its tree of
rays depth first: the refracted ray goes on, the reflected one waits on a stack in local memory.

Left out, because the room never needs it: no child is deeper than the cut-off allows, so there is no
`max_depth`; rays that miss add nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import drjit as dr
import mitsuba as mi
from drjit.llvm.ad import Array3f, Array4f, Bool, Float, UInt32
from mitsuba_room import Room, load_room

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np

TILE = 8  # pixels; the lanes of one tile follow a Morton curve
SLACK = 1e-6  # of the cut-off: a child is traced when w * k > cutoff - 1e-6
OFFSET_FACTOR = 1e-5  # secondary rays start this far along their direction, in scene extents


@dataclass
class PendingRay:
    """A ray of the tree that is still to be traced (entry of the stack in local memory)."""

    o: Array3f  # origin
    d: Array3f  # direction, unit length
    throughput: Array3f  # product of own colors, (1 - ambient) and factors on the way
    weight: Float  # product of the factors alone: what the cut-off tests


@dataclass
class RayCounts:
    """Rays of one frame by kind."""

    primary: int = 0
    reflected: int = 0
    refracted: int = 0
    shadow: int = 0

    @property
    def total(self) -> int:
        return self.primary + self.reflected + self.refracted + self.shadow


def pixel_of_lane(width: int, height: int, order: str) -> tuple[UInt32, UInt32]:
    """Pixel (i, j) of each lane: row by row ("scan"), or tiles of 8 x 8 along a Morton curve ("morton")."""
    lane = dr.arange(UInt32, width * height)
    if order == "scan":
        return lane % width, lane // width
    tile, within = lane >> 6, lane & 63
    i = (within & 1) | ((within >> 1) & 2) | ((within >> 2) & 4)
    j = ((within >> 1) & 1) | ((within >> 2) & 2) | ((within >> 3) & 4)
    tiles = width // TILE
    return (tile % tiles) * TILE + i, (tile // tiles) * TILE + j


def own_color(room: Room, p: Array3f, scale: Float, first: Float, texture: Array4f, active: Bool) -> Array3f:
    """Color of the texture at p: solid, stripes and checker by one formula (document, section 6)."""
    q = p * scale
    epsilon = 1e-5 * dr.maximum(1, dr.max(dr.abs(q)))
    stripes = dr.floor(q.x + q.y + q.z + epsilon)
    checker = dr.floor(q.x + epsilon) + dr.floor(q.y + epsilon) + dr.floor(q.z + epsilon)
    cell = dr.select(texture.y > 0, stripes, checker)
    cell -= texture.x * dr.floor((cell + 0.5) / texture.x)
    rgb = dr.gather(Array4f, room.palette, UInt32(first + cell), active)
    return Array3f(rgb.x, rgb.y, rgb.z)


def is_occluded(room: Room, ray: mi.Ray3f, occlusion: str, active: Bool) -> Bool:
    if occlusion == "test":
        return room.scene.ray_test(ray, active=active)
    return room.scene.ray_intersect_preliminary(ray, active=active).is_valid()


@dr.syntax
def direct_light(
    room: Room, p: Array3f, d: Array3f, n: Array3f, phong: Array4f, occlusion: str, active: Bool
) -> tuple[Float, UInt32]:
    """The lights' Lambert and Phong terms (document, section 2), and how many shadow rays that took."""
    offset = OFFSET_FACTOR * room.extent
    total, rays = Float(0), UInt32(0)
    for light in room.lights:
        to_light = light.position - p
        distance = dr.norm(to_light)
        to_light = to_light / distance
        cosine = dr.dot(n, to_light)
        lit = active & (cosine > 0) & (phong.x + phong.y > 0)
        rays += dr.select(lit, UInt32(1), UInt32(0))
        ray = mi.Ray3f(p + offset * to_light, to_light, distance - 2 * offset, Float(0), [])
        lit &= ~is_occluded(room, ray, occlusion, lit)
        aligned = -dr.dot(2 * cosine * n - to_light, d)
        highlight = Float(0)
        if lit & (phong.y > 0) & (aligned > 0):  # a real branch: packets on dull surfaces skip the power
            highlight = dr.power(aligned, phong.z)
        total += dr.select(lit, light.weight * (phong.x * cosine + phong.y * highlight), 0)
    return total, rays


@dr.syntax
def trace(room: Room, o: Array3f, d: Array3f, occlusion: str, count: bool) -> tuple[Array3f, list[UInt32]]:
    """Color seen along each ray of width n, and [reflected, refracted, shadow] rays (zero unless `count`)."""
    n = dr.width(d)
    offset = OFFSET_FACTOR * room.extent
    least = room.cutoff - SLACK
    stack = dr.alloc_local(PendingRay, int(1 / least))  # together, pending rays weigh at most 1

    active = dr.full(Bool, True, n)
    throughput = dr.full(Array3f, 1, n)
    weight = dr.full(Float, 1, n)
    color = dr.zeros(Array3f, n)
    top = dr.zeros(UInt32, n)  # full width: of width 1 it would count as uniform and read garbage
    reflected, refracted, shadow = (dr.zeros(UInt32, n) for _ in range(3))

    while dr.hint(active, label="whitted", exclude=[room]):
        # ---- What the ray hits ----
        hit = room.scene.ray_intersect_preliminary(mi.Ray3f(o, d), active=active)
        valid = active & hit.is_valid()
        p = o + hit.t * d
        base = hit.shape_index * 4
        geometry = dr.gather(Array4f, room.table, base, valid)
        phong = dr.gather(Array4f, room.table, base + 1, valid)
        lobes = dr.gather(Array4f, room.table, base + 2, valid)
        texture = dr.gather(Array4f, room.table, base + 3, valid)

        outward = p * geometry.w - Array3f(geometry.x, geometry.y, geometry.z)
        entering = dr.dot(outward, d) < 0
        normal = dr.select(entering, outward, -outward)
        own = own_color(room, p, lobes.z, lobes.w, texture, valid)

        # ---- Light that arrives on straight ways ----
        light, rays = direct_light(room, p, d, normal, phong, occlusion, valid)
        color += dr.select(valid, throughput * own * (room.ambient + light), 0)
        if dr.hint(count, mode="scalar"):
            shadow += rays

        # ---- The two children, and which of them goes on ----
        c = -dr.dot(normal, d)
        eta = dr.select(entering, dr.rcp(phong.w), phong.w)
        k = 1 - eta * eta * (1 - c * c)
        r = d + 2 * c * normal
        t = eta * d + (eta * c - dr.sqrt(dr.maximum(k, 0))) * normal
        weight_r, weight_t = weight * lobes.x, weight * lobes.y
        has_r = valid & (weight_r > least)
        has_t = valid & (weight_t > least) & (k >= 0)
        if dr.hint(count, mode="scalar"):
            reflected += dr.select(has_r, UInt32(1), UInt32(0))
            refracted += dr.select(has_t, UInt32(1), UInt32(0))

        passed = throughput * own * (1 - room.ambient)
        if has_r & has_t:
            stack[top] = PendingRay(p + offset * r, r, passed * lobes.x, weight_r)
            top += 1
        d = dr.select(has_t, t, r)
        o = p + offset * d
        throughput = passed * dr.select(has_t, lobes.y, lobes.x)
        weight = dr.select(has_t, weight_t, weight_r)

        # ---- A leaf of the tree: the ray on top of the stack is next ----
        active &= has_r | has_t | (top > 0)
        if active & ~(has_r | has_t):
            top -= 1
            entry = stack[top]
            o, d, throughput, weight = entry.o, entry.d, entry.throughput, entry.weight

    return color, [reflected, refracted, shadow]


def frame(room: Room, order: str, occlusion: str, count: bool) -> tuple[Float, list[UInt32]]:
    """Interleaved RGB of the frame and the counters of each pixel, not evaluated yet."""
    camera = room.camera
    i, j = pixel_of_lane(camera.width, camera.height, order)
    o = camera.corner + Float(i) * camera.x_step + Float(j) * camera.y_step
    color, counts = trace(room, o, dr.normalize(o - camera.eye), occlusion, count)
    image = dr.empty(Float, 3 * camera.width * camera.height)
    dr.scatter(image, color, j * camera.width + i, mode=dr.ReduceMode.Permute)
    return image, counts


@dr.freeze
def frozen_image(room: Room, order: str, occlusion: str) -> Float:
    """The frame's colors; frozen, so that later frames do without tracing the kernel in Python (3 ms)."""
    return frame(room, order, occlusion, count=False)[0]


class MitsubaWhitted:
    """Renders a scene file by Whitted's algorithm with Mitsuba's ray queries.

    Parameters
    ----------
    path: scene file (TOML), see the module's text for the kinds it may hold.
    size: pixels across, the scene's resolution if None; the framing stays.
    order: "morton" (8 x 8 tiles; width and height must be multiples of 8) or "scan".
    occlusion: "preliminary" asks for the closest hit of shadow rays too; "test" uses `Scene.ray_test`, which
        Mitsuba recommends, but whose sphere formula is inaccurate for small distant spheres.
    """

    def __init__(
        self, path: str | Path, size: int | None = None, order: str = "morton", occlusion: str = "preliminary"
    ) -> None:
        self.room = load_room(path, size)
        self.occlusion = occlusion
        self.order = order
        if order == "morton" and (self.room.camera.width % TILE or self.room.camera.height % TILE):
            raise ValueError(f"morton order needs a width and height that {TILE} divides")

    def render(self) -> np.ndarray:
        """The picture, float32 (height, width, 3), display-referred."""
        camera = self.room.camera
        image = frozen_image(self.room, self.order, self.occlusion)
        dr.eval(image)
        dr.sync_thread()
        return image.numpy().reshape(camera.height, camera.width, 3)

    def count_rays(self) -> RayCounts:
        """Rays by kind, from a frame of its own (counting costs a little time)."""
        _, counts = frame(self.room, self.order, self.occlusion, count=True)
        reflected, refracted, shadow = (int(dr.sum(c)[0]) for c in counts)
        return RayCounts(self.room.camera.width * self.room.camera.height, reflected, refracted, shadow)
