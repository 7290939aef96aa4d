"""The tree of rays of every pixel, for `reference.whitted` (document, sections 2 and 3).

One symbolic loop. Each pixel is a lane and traces its tree depth first: the refracted ray goes on, the
reflected one waits on a stack in local memory.
"""

from __future__ import annotations

from dataclasses import dataclass

from reference.mitsuba_variant import mitsuba
from reference.whitted_lights import Jitter
from reference.whitted_shading import Surface, direct_light, offset, surface_at
from reference.whitted_types import Array3f, Bool, Float, UInt32, dr
from reference.whitted_world import World


@dataclass
class PendingRay:
    """A ray of the tree that is still to be traced (entry of the stack in local memory)."""

    o: Array3f
    d: Array3f
    throughput: Array3f  # product of own colors, (1 - ambient) and factors on the way
    weight: Float  # product of the factors alone: what the cut-off tests
    level: UInt32


@dataclass
class Counts:
    """What each lane counts."""

    shadow: UInt32
    reflected: UInt32
    refracted: UInt32
    total_reflection: UInt32
    total_internal: UInt32
    ended_by_cutoff: UInt32
    ended_by_depth: UInt32
    deepest_level: UInt32


@dataclass
class Children:
    """The two secondary rays of n hits: mirrored with factor k_r, and refracted (or mirrored totally) with
    factor k_t; which of them are traced, and their weights."""

    mirrored: Array3f
    passed: Array3f
    total: Bool  # the second is mirrored totally, or (by the option) dropped
    has_mirrored: Bool
    has_passed: Bool
    mirrored_weight: Float
    passed_weight: Float


@dr.syntax
def trace(
    world: World, o: Array3f, d: Array3f, jitters: list[Jitter | None], pixels: Bool, count: bool
) -> tuple[Array3f, Float, Counts]:
    """Color seen along each of n rays and depth of the first hit; counts by lane (zeros unless `count`)."""
    n = dr.width(d)
    options = world.options
    stack = dr.alloc_local(PendingRay, options.stack)

    active = Bool(pixels)
    o, d = Array3f(o), Array3f(d)
    throughput = dr.full(Array3f, 1, n)
    weight = dr.full(Float, 1, n)
    level = dr.zeros(UInt32, n)
    color, depth = dr.zeros(Array3f, n), dr.full(Float, -1, n)
    top = dr.zeros(UInt32, n)  # full width: of width 1 it would count as uniform and read garbage
    counts = dr.zeros(Counts, n)

    while dr.hint(active, label="whitted", exclude=[world, jitters, options]):
        # ---- What the ray hits ----
        ray = mitsuba().Ray3f(o, d)
        hit = world.scene.ray_intersect_preliminary(ray, active=active)
        valid = active & hit.is_valid()
        sees_background = active & ~valid
        if dr.hint(not options.secondary_background, mode="scalar"):
            sees_background &= level == 0
        color += dr.select(sees_background, throughput * world.background, 0)
        depth = dr.select(valid & (level == 0), hit.t, depth)
        surface = surface_at(world, o, d, hit, valid)

        # ---- Light that arrives on straight ways ----
        light, rays = direct_light(world, surface, jitters, valid)
        color += dr.select(valid, throughput * surface.color * (world.ambient + light), 0)

        # ---- The two children, and which of them goes on ----
        children = children_of(world, surface, weight, level, valid)
        if dr.hint(count, mode="scalar"):
            counts = counted(world, counts, surface, children, rays, valid)
            counts.deepest_level = dr.maximum(counts.deepest_level, dr.select(active, level, 0))
        passed = throughput * surface.color * (1 - world.ambient)
        start = offset(world, surface.p)
        # The comparison always holds. It puts the size into the kernel's text, which is all that Dr.Jit looks
        # at when it asks whether it knows a kernel; else one with a smaller stack is taken.
        both = children.has_mirrored & children.has_passed & (top < options.stack)
        if both:
            waiting = surface.p + start * children.mirrored
            stack[top] = PendingRay(
                waiting,
                children.mirrored,
                passed * surface.row.reflection,
                children.mirrored_weight,
                level + 1,
            )
            top += 1
        onward = children.has_passed
        d = dr.select(onward, children.passed, children.mirrored)
        o = surface.p + start * d
        throughput = passed * dr.select(onward, surface.row.refraction, surface.row.reflection)
        weight = dr.select(onward, children.passed_weight, children.mirrored_weight)
        level += 1

        # ---- A leaf of the tree: the ray on top of the stack is next ----
        goes_on = children.has_mirrored | children.has_passed
        active &= goes_on | (top > 0)
        if active & ~goes_on:
            top -= 1
            entry = stack[top]
            o, d, throughput, weight, level = entry.o, entry.d, entry.throughput, entry.weight, entry.level

    return color, depth, counts


def children_of(world: World, surface: Surface, weight: Float, level: UInt32, active: Bool) -> Children:
    """The secondary rays that pass the cut-off and the depth limit (document, section 3)."""
    row, d, normal = surface.row, surface.d, surface.shading
    c = -dr.dot(normal, d)
    eta = dr.select(surface.entering, dr.rcp(row.ior), row.ior)
    k = 1 - eta * eta * (1 - c * c)
    total = k < 0
    mirrored = unit(d + 2 * c * normal)
    refracted = unit(eta * d + (eta * c - dr.sqrt(dr.maximum(k, 0))) * normal)
    if world.options.straight:
        refracted = dr.select(row.ior == 1, d, refracted)
        total &= row.ior != 1
    mirrored_weight, passed_weight = weight * row.reflection, weight * row.refraction
    deep_enough = active & (level < world.options.max_depth) if world.options.level_bound else active
    has_mirrored = deep_enough & (mirrored_weight > world.least_weight)
    has_passed = deep_enough & (passed_weight > world.least_weight)
    if world.options.reflect_totally:
        refracted = dr.select(total, mirrored, refracted)
    else:
        has_passed &= ~total
    return Children(mirrored, refracted, total, has_mirrored, has_passed, mirrored_weight, passed_weight)


def counted(
    world: World,
    counts: Counts,
    surface: Surface,
    children: Children,
    shadow_rays: UInt32,
    active: Bool,
) -> Counts:
    """The counts of each lane with one more hit (document, sections 2 and 3)."""
    row, least = surface.row, world.least_weight
    mirrors, refracts = active & (row.reflection > 0), active & (row.refraction > 0)
    asks = refracts if world.options.reflect_totally else refracts & ~children.total
    heavy = [mirrors & (children.mirrored_weight > least), asks & (children.passed_weight > least)]
    light = [mirrors & (children.mirrored_weight <= least), asks & (children.passed_weight <= least)]
    deep = [heavy[0] & ~children.has_mirrored, heavy[1] & ~children.has_passed]
    return Counts(
        shadow=counts.shadow + shadow_rays,
        reflected=counts.reflected + ones(children.has_mirrored),
        refracted=counts.refracted + ones(children.has_passed & ~children.total),
        total_reflection=counts.total_reflection + ones(children.has_passed & children.total),
        total_internal=counts.total_internal + ones(refracts & children.total),
        ended_by_cutoff=counts.ended_by_cutoff + ones(light[0]) + ones(light[1]),
        ended_by_depth=counts.ended_by_depth + ones(deep[0]) + ones(deep[1]),
        deepest_level=counts.deepest_level,
    )


def ones(mask: Bool) -> UInt32:
    """1 where the mask holds."""
    return dr.select(mask, UInt32(1), UInt32(0))


def unit(v: Array3f) -> Array3f:
    """v / |v|; `dr.normalize` takes an approximate root."""
    return v / dr.norm(v)
