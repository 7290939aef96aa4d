"""Whitted's recursion as one loop (document, sections 2 and 3): every pixel's tree of rays, depth first.

One lane owns one pixel. It traces a ray, adds the light of the surface, goes on with one child and keeps the
other on a stack; when the stack is empty it takes the pixel's next sub-ray, so no lane waits for its
neighbors. Because the pending rays of a pixel weigh at most 1 together and at least the cut-off each, the
stack is short.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import partial
from typing import Any

import drjit as dr

from tracer.acceleration.bundles import DOUBTFUL
from tracer.acceleration.shadows_of_bundles import HIDDEN
from tracer.arrival import DirectLight
from tracer.backends import INVALID, Backend
from tracer.canvas import DeviceCanvas
from tracer.device_scene import DeviceScene
from tracer.direct_light import direct_light
from tracer.few_lights import Shadows
from tracer.first_hits import FirstHits
from tracer.intersection import Known, closest_hit, free_ray
from tracer.path import make_path, path_type
from tracer.pixels import PixelGrid, primary_ray
from tracer.spawn import material_at, spawn
from tracer.sums import Sums
from tracer.surface import Surface, surface_at
from tracer.textures.tables import texture_color


@dataclass
class PixelColumns:
    """What the loop finds for n pixels: mean `color` (3, n), `coverage` (share of sub-rays that hit), and of
    the nearest sub-ray `depth` (-1: none), `view_depth` (how far the hit is from the eye along the view
    axis, infinite: none), `primitive` and `sub_ray`; `counts`: rays by kind; `sums`: the layers of
    `tracer.sums` that are asked for, (components, n)."""

    color: Any
    coverage: Any
    depth: Any
    view_depth: Any
    primitive: Any
    sub_ray: Any
    counts: Counts
    sums: dict[str, Any]


@dataclass
class Counts:
    """Rays of a pixel by kind, and why its paths ended (n,)."""

    shadow: Any
    reflected: Any
    refracted: Any
    total_reflection: Any
    total_internal: Any
    ended_by_cutoff: Any
    ended_by_depth: Any
    deepest_level: Any

    @staticmethod
    def zero(backend: Backend, width: int) -> Counts:
        """Counters in full width, each with memory of its own."""
        return Counts(*(dr.zeros(backend.UInt32, width) for _ in fields(Counts)))


@dr.syntax
def trace_pixels(
    scene: DeviceScene,
    canvas: DeviceCanvas,
    pixels: PixelGrid,
    first: FirstHits | None,
    layers: tuple[str, ...] = (),
    met: Any = None,
) -> PixelColumns:
    """The colors, depths and ray counts of pixels, and layers that are sums. `first`: what is known
    of primary rays. `met` (shapes,): where rays count themselves by the shape that they meet; None where
    nobody asks."""
    # ---- Loop state, all of it in full width ----
    backend = scene.backend
    width = dr.width(pixels.number)
    record = path_type(backend, scene.triangles is not None)
    path = dr.zeros(record, width)  # the ray in hand
    fresh = dr.full(backend.Bool, True, width)  # ... is still to be made from the next sub-ray
    sub_ray = dr.zeros(backend.UInt32, width)  # number of the current sub-ray
    stack = dr.alloc_local(record, scene.stack_size)  # rays that wait
    top = dr.zeros(backend.UInt32, width)  # how many of them
    color = dr.zeros(backend.Vector3, width)  # sum over the sub-rays
    hits = dr.zeros(backend.UInt32, width)  # sub-rays that hit something
    depth = dr.full(backend.Float, float("inf"), width)  # of the nearest sub-ray
    view_depth = dr.full(backend.Float, float("inf"), width)  # the same along the view axis
    nearest = dr.full(backend.UInt32, INVALID, width)  # its primitive
    nearest_sub_ray = dr.zeros(backend.UInt32, width)  # its number
    counts = Counts.zero(backend, width)
    sums = Sums.zero(scene, layers, width)
    active = backend.Bool(pixels.active)

    while dr.hint(active, label="whitted", exclude=[scene, canvas, pixels, first, met, backend, record]):
        # ---- The next sub-ray of the pixel ----
        if dr.hint(fresh, exclude=[scene, canvas, pixels, first, backend, record]):
            path = primary_path(scene, canvas, pixels, sub_ray)

        # ---- The nearest surface ----
        is_primary = path.level == 0
        number = sub_ray * pixels.lanes + pixels.lane
        known = _known_triangle(backend, first, number, active & is_primary)
        hit = closest_hit(scene, path.ray, active, known=known)
        surface = surface_at(scene, path.ray, hit, active)
        found = active & hit.valid
        counts.deepest_level = dr.maximum(counts.deepest_level, path.level)
        if dr.hint(met is not None, mode="scalar"):
            dr.scatter_add(met, type(met)(1), surface.shape, found)
        closer = is_primary & found & (hit.t < depth)
        hits += dr.select(is_primary & found, backend.UInt32(1), 0)
        depth = dr.select(closer, hit.t, depth)
        view_depth = dr.select(closer, hit.t * dr.dot(path.d, canvas.axis), view_depth)
        nearest = dr.select(closer, hit.primitive, nearest)
        nearest_sub_ray = dr.select(closer, sub_ray, nearest_sub_ray)

        # ---- Its own light, or the background ----
        material = material_at(scene, surface, found)
        point = texture_point(scene, surface, found)
        own = texture_color(backend, scene.textures, material.texture, point, found)
        watch = sums.watch(is_primary)
        shadows = _known_shadows(backend, first, number, active & is_primary)
        light = direct_light(
            scene, path.ray, surface, material.finish, pixels.number, sub_ray, found, watch, shadows
        )
        counts.shadow += light.shadow_rays
        base = path.throughput * own
        local = base * dr.fma(scene.not_ambient * material.absorption, light.total, scene.ambient)
        sees_background = active & ~hit.valid
        if dr.hint(not scene.options.secondary_background, mode="scalar"):
            sees_background &= is_primary
        color += dr.select(found, local, 0)
        color += dr.select(sees_background, path.throughput * scene.background, 0)
        if dr.hint(layers != (), mode="scalar"):
            behind = dr.select(sees_background, path.throughput * scene.background, 0)
            own_parts = partial(_own_parts, scene, base, material.absorption, light, found, behind)
            sums = sums.with_light(is_primary, own_parts, dr.select(found, local, behind))

        # ---- Its children ----
        children = spawn(scene, path, surface, material, base * scene.not_ambient, found)
        reflects, refracts = children.reflects, children.refracts
        counts.reflected += dr.select(reflects, backend.UInt32(1), 0)
        counts.refracted += dr.select(refracts & ~children.total, backend.UInt32(1), 0)
        counts.total_reflection += dr.select(refracts & children.total, backend.UInt32(1), 0)
        counts.total_internal += dr.select(children.total, backend.UInt32(1), 0)
        counts.ended_by_cutoff += children.ended_by_cutoff
        counts.ended_by_depth += children.ended_by_depth

        # ---- Go on with one of them, or one that waits, or the next sub-ray ----
        path = dr.select(refracts, children.refracted, children.reflected)
        # Never False, but the size must stand in the kernel: Dr.Jit tells kernels apart by what they do, not
        # by the size of local memory, and would take one with a smaller stack from its cache.
        fits = top < scene.stack_size
        if dr.hint(reflects & refracts & fits, exclude=[scene, canvas, pixels, first, backend, record]):
            stack.write(children.reflected, top)
            top += 1
        pops = active & ~reflects & ~refracts & (top > 0)
        if dr.hint(pops, exclude=[scene, canvas, pixels, first, backend, record]):
            top -= 1
            path = stack.read(top)
        sums = sums.with_next(path.level, refracts)
        fresh = active & ~reflects & ~refracts & ~pops
        sub_ray += dr.select(fresh, backend.UInt32(1), 0)
        active &= sub_ray < pixels.n * pixels.n
        fresh &= active

    share = dr.rcp(backend.Float(pixels.n * pixels.n))
    return PixelColumns(
        color=color * share,
        coverage=backend.Float(hits) * share,
        depth=dr.select(hits > 0, depth, -1),
        view_depth=canvas.distance + view_depth,
        primitive=nearest,
        sub_ray=nearest_sub_ray,
        counts=counts,
        sums=sums.layers(hits, share, scene.lights.number),
    )


def _own_parts(
    scene: DeviceScene, base: Any, absorption: Any, light: DirectLight, found: Any, behind: Any
) -> dict[str, Any]:
    """The parts of the light of hits themselves, and the background `behind` where nothing is hit, which
    counts as ambient light; `base` (3, n): what their light is worth."""
    direct = base * (scene.not_ambient * absorption)
    parts = {"ambient": dr.select(found, base * scene.ambient, behind)}
    for specular in light.specular:
        parts["specular"] = dr.select(found, direct * specular, 0)
        parts["diffuse"] = dr.select(found, direct * (light.total - specular), 0)
    return parts


def _known_triangle(backend: Backend, first: FirstHits | None, number: Any, is_primary: Any) -> Known | None:
    """What is known of the hits of primary rays; `number`: that of a ray among all of its launch."""
    if first is None:
        return None
    slot = dr.gather(backend.UInt32, first.slot, number, is_primary)
    return Known(is_primary & (slot != DOUBTFUL), slot)


def _known_shadows(backend: Backend, first: FirstHits | None, number: Any, is_primary: Any) -> Shadows | None:
    """What is known of the lights of primary hits."""
    if first is None or not first.hidden:
        return None
    found = [dr.gather(backend.UInt32, hidden, number, is_primary) for hidden in first.hidden]
    known = [is_primary & (answer != DOUBTFUL) for answer in found]
    return Shadows(known, [answer == HIDDEN for answer in found])


def primary_path(scene: DeviceScene, canvas: DeviceCanvas, pixels: PixelGrid, sub_ray: Any) -> Any:
    """The path of a pixel's sub-ray b n + a, through (i + (a + offset)/n, j + (b + offset)/n)."""
    backend = scene.backend
    o, d = primary_ray(backend, canvas, pixels, sub_ray)
    width = dr.width(d)
    return make_path(
        backend,
        free_ray(scene, o, d),
        dr.full(backend.Float, 1, width),
        dr.full(backend.Vector3, 1, width),
        dr.zeros(backend.UInt32, width),
    )


def texture_point(scene: DeviceScene, surface: Surface, active: Any) -> Any:
    """The argument of the texture: the world point, or the point before the shape's own transform."""
    if scene.object_space is None:
        return surface.p
    backend = scene.backend
    rows = [dr.gather(backend.Vector4, scene.object_space, surface.shape * 3 + k, active) for k in range(3)]
    p = surface.p
    return backend.Vector3(*(dr.fma(r.x, p.x, dr.fma(r.y, p.y, dr.fma(r.z, p.z, r.w))) for r in rows))
