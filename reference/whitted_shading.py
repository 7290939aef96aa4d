"""The surface at Mitsuba's hits and the light on it, for `reference.whitted` (document, sections 2, 4, 5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from reference.mitsuba_variant import mitsuba
from reference.whitted_lights import Jitter, Light, sample_position
from reference.whitted_tables import CORNER_ROWS, MESH, SMOOTH, ShapeRow, Tables, rows, xyz
from reference.whitted_textures import own_color
from reference.whitted_types import Array3f, Array4f, Bool, Float, UInt32, dr
from reference.whitted_world import World

UNROLLED = 4  # samples of a light that stand in the kernel one by one; more are looped over


@dataclass
class Surface:
    """n hits as their rays `d` see them: the point on the surface, geometric and shading normal facing the
    ray, whether the ray enters, and the own color."""

    row: ShapeRow
    d: Array3f
    p: Array3f
    facing: Array3f
    shading: Array3f
    entering: Bool
    color: Array3f


def surface_at(world: World, o: Array3f, d: Array3f, hit: Any, active: Bool) -> Surface:
    """The surface at preliminary hits of rays o + t d."""
    tables = world.tables
    row = ShapeRow.gather(tables, hit.shape_index, active)
    p, outward = settled(tables, row, o + hit.t * d, hit, active)
    entering = dr.dot(outward, d) < 0
    facing = shading = dr.select(entering, outward, -outward)
    if tables.has(SMOOTH):
        smooth = smooth_normal(tables, row, hit, active & row.has(SMOOTH))
        smooth = dr.select(entering, smooth, -smooth)
        shading = dr.select(row.has(SMOOTH) & (dr.dot(smooth, d) <= 0), smooth, facing)
    return Surface(row, d, p, facing, shading, entering, own_color(tables, row, p, active))


def settled(tables: Tables, row: ShapeRow, p: Array3f, hit: Any, active: Bool) -> tuple[Array3f, Array3f]:
    """Points put back onto their surfaces, off which they were rounded, and the outward normals there."""
    plane = xyz(row.place)
    height = dr.dot(plane, p) + row.size
    if tables.has(MESH):
        number = row.first_triangle + hit.prim_index
        facet = dr.gather(Array4f, tables.facets, number, active & row.has(MESH))
        plane = dr.select(row.has(MESH), xyz(facet), plane)
        height = dr.select(row.has(MESH), dr.dot(plane, p) + facet.w, height)
    radial = (p - xyz(row.place)) * row.place.w
    length = dr.norm(radial)
    is_sphere = row.place.w != 0
    outward = dr.select(is_sphere, radial / length, plane)
    height = dr.select(is_sphere, row.size * (length - 1), height)
    return p - height * outward, outward


def smooth_normal(tables: Tables, row: ShapeRow, hit: Any, active: Bool) -> Array3f:
    """The corner normals weighted by barycentrics; NaN where they cancel, which no comparison passes."""
    a, b, c = rows(tables.corners, row.first_triangle + hit.prim_index, CORNER_ROWS, active)
    u, v = hit.prim_uv.x, hit.prim_uv.y
    return dr.normalize((1 - u - v) * xyz(a) + u * xyz(b) + v * xyz(c))


def offset(world: World, p: Array3f) -> Float:
    """How far from p rays start: in proportion to the rounding of p, also far out on a plane."""
    return world.start * dr.maximum(world.extent, dr.max(dr.abs(p)))


def direct_light(
    world: World, surface: Surface, jitters: list[Jitter | None], active: Bool
) -> tuple[Any, UInt32]:
    """(1 - a) k_a (m D + h H), one number where all lights are white and else a color; the shadow rays."""
    total, shadow_rays = Array3f(0) if not world.options.white else Float(0), UInt32(0)
    for light, jitter in zip(world.lights, jitters, strict=True):
        if light.count <= UNROLLED:
            parts = [
                light_of_sample(world, surface, sample_position(light, jitter, UInt32(k), active), active)
                for k in range(light.count)
            ]
            arriving, rays = sum(part for part, _ in parts), sum(count for _, count in parts)
        else:
            arriving, rays = light_of_many(world, surface, light, jitter, active)
        total += light.share * arriving if world.options.white else light.share * arriving * light.color
        shadow_rays += rays
    return total, shadow_rays


@dr.syntax
def light_of_many(
    world: World, surface: Surface, light: Light, jitter: Jitter | None, active: Bool
) -> tuple[Float, UInt32]:
    """The sum over the samples of one light, and the shadow rays."""
    n = dr.width(active)
    k, rays, total = dr.zeros(UInt32, n), dr.zeros(UInt32, n), dr.zeros(Float, n)
    while dr.hint(active & (k < light.count), label="light", exclude=[world, surface, light, jitter, active]):
        position = sample_position(light, jitter, k, active)
        part, count = light_of_sample(world, surface, position, active)
        total += part
        rays += count
        k += 1
    return total, rays


@dr.syntax
def light_of_sample(world: World, surface: Surface, position: Array3f, active: Bool) -> tuple[Float, UInt32]:
    """(1 - a) k_a (m D + h H) of one shining point of share 1, and the shadow rays, one or none."""
    row, to_light = surface.row, position - surface.p
    distance = dr.norm(to_light)
    to_light = to_light / distance
    cosine = dr.dot(surface.shading, to_light)
    lit = active & (distance > 0) & (cosine > 0)
    if dr.hint(world.tables.has(SMOOTH), mode="scalar"):
        lit &= dr.dot(surface.facing, to_light) > 0
    count = dr.select(lit, UInt32(1), UInt32(0))
    lit &= row.diffuse + row.specular > 0
    share = unobstructed(world, surface.p, to_light, distance, lit)
    aligned = dr.maximum(-dr.dot(2 * cosine * surface.shading - to_light, surface.d), 0)
    highlight: Any = dr.select(row.shininess == 0, Float(1), Float(0))
    if lit & (share > 0) & (row.specular > 0) & (aligned > 0):  # a branch: dull surfaces skip the power
        highlight = dr.power(aligned, row.shininess)
    diffuse = aligned if dr.hint(world.options.diffuse_reflection, mode="scalar") else cosine
    return dr.select(lit, share * (row.diffuse * diffuse + row.specular * highlight), 0), count


def unobstructed(world: World, p: Array3f, to_light: Array3f, distance: Float, active: Bool) -> Float:
    """V: the share of a light's rays that arrives at p (document, section 4)."""
    start = offset(world, p)
    o, reach = p + start * to_light, distance - 2 * start
    if world.options.transparent_shadows:
        return transmitted(world, o, to_light, reach, start, active)
    return dr.select(blocker(world, o, to_light, reach, active).is_valid(), Float(0), Float(1))


def blocker(world: World, o: Array3f, d: Array3f, reach: Float, active: Bool) -> Any:
    """The nearest hit within `reach`; asked for whole, because `ray_test` is off at small distant spheres."""
    ray = mitsuba().Ray3f(o, d, reach, Float(0), [])
    return world.scene.ray_intersect_preliminary(ray, active=active)


@dr.syntax
def transmitted(world: World, o: Array3f, d: Array3f, reach: Float, start: Float, active: Bool) -> Float:
    """The product of k_t over all surfaces on the way; two that an edge joins are one."""
    share = dr.full(Float, 1, dr.width(active))
    going = Bool(active)
    o, reach = Array3f(o), Float(reach)
    while dr.hint(going, label="shadow", exclude=[world, d, start]):
        hit = blocker(world, o, d, reach, going)
        going &= hit.is_valid()
        refraction = ShapeRow.gather(world.tables, hit.shape_index, going).refraction
        share = dr.select(going, share * refraction, share)
        step = hit.t + start
        o = dr.select(going, o + step * d, o)
        reach = dr.select(going, reach - step, reach)
        going &= (share > 0) & (reach > 0)
    return share
