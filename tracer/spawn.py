"""The children of a ray: mirrored and refracted, and the cut-off that ends them (document, section 3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.arrival import Finish
from tracer.branches import changed_where
from tracer.device_scene import DeviceScene
from tracer.leaving import leave
from tracer.path import make_path
from tracer.ray import Ray, normalize, unit_again
from tracer.surface import Surface
from tracer.textures.tables import TextureRow


@dataclass
class MaterialRow:
    """The material at n hits: `ior`, shares `reflection` k_r, `refraction` k_t, `absorption` k_a, its finish,
    and the texture."""

    ior: Any
    reflection: Any
    refraction: Any
    absorption: Any
    finish: Finish
    texture: TextureRow


@dataclass
class Children:
    """The rays that follow a hit: paths `reflected`, `refracted`, and masks which of them are traced.

    `total`: total internal reflection; where it is traced at all, its ray stands in `refracted`.
    `ended_by_cutoff`, `ended_by_depth`: how many children were not traced, and why.
    """

    reflected: Any
    refracted: Any
    reflects: Any
    refracts: Any
    total: Any
    ended_by_cutoff: Any
    ended_by_depth: Any


def material_at(scene: DeviceScene, surface: Surface, active: Any) -> MaterialRow:
    """The material of the surfaces."""
    backend = scene.backend
    a, b = (dr.gather(backend.Vector4, scene.surfaces, surface.shape * 2 + k, active) for k in range(2))
    ids = surface.ids
    texture = TextureRow(ids.x, ids.y, ids.z, b.w, surface.shape)
    return MaterialRow(a.x, a.y, a.z, a.w, Finish(b.x, b.y, b.z), texture)


def refract_direction(d: Any, n: Any, ior: Any, entering: Any) -> tuple[Any, Any]:
    """t = eta d + (eta c - sqrt(k)) n with k = 1 - eta^2 (1 - c^2), and the mask of total reflection, k < 0.

    eta = 1/ior entering, ior leaving. With ior = 1 the ray goes straight on, exactly.
    """
    eta = dr.select(entering, dr.rcp(ior), ior)
    c = -dr.dot(n, d)
    k = dr.fma(-eta * eta, dr.fma(-c, c, 1), 1)
    bent = unit_again(normalize(dr.fma(eta, d, (eta * c - dr.sqrt(k)) * n)))
    return dr.select(ior == 1, d, bent), (k < 0) & (ior != 1)


def spawn(
    scene: DeviceScene, path: Any, surface: Surface, material: MaterialRow, base: Any, active: Any
) -> Children:
    """The children at a hit; `base` (3, n) is the throughput of the parent times own color times (1 - a)."""
    ray: Ray = path.ray
    k_r, k_t = material.reflection, material.refraction
    through, total = changed_where(
        active & (k_t > 0),
        (ray.d, dr.full(scene.backend.Bool, False, dr.width(ray.d))),
        lambda _: refract_direction(ray.d, surface.normal, material.ior, surface.entering),
        label="refraction",
    )
    total = active & total & (k_t > 0)
    wants_mirror = active & (k_r > 0)
    wants_through = active & (k_t > 0) & (True if scene.options.tir_reflects else ~total)
    heavy_mirror = path.weight * k_r > scene.cutoff
    heavy_through = path.weight * k_t > scene.cutoff
    deep = path.level >= scene.max_depth
    second = leave(ray, surface, through, crosses=True)
    if scene.options.tir_reflects:
        second = dr.select(total, leave(ray, surface, surface.mirrored, crosses=False), second)
    level = path.level + 1
    one, none = scene.backend.UInt32(1), scene.backend.UInt32(0)

    def count(a: Any, b: Any) -> Any:
        return dr.select(a, one, none) + dr.select(b, one, none)

    return Children(
        reflected=make_path(
            scene.backend,
            leave(ray, surface, surface.mirrored, crosses=False),
            path.weight * k_r,
            base * k_r,
            level,
        ),
        refracted=make_path(scene.backend, second, path.weight * k_t, base * k_t, level),
        reflects=wants_mirror & heavy_mirror & ~deep,
        refracts=wants_through & heavy_through & ~deep,
        total=total,
        ended_by_cutoff=count(wants_mirror & ~heavy_mirror, wants_through & ~heavy_through),
        ended_by_depth=count(wants_mirror & heavy_mirror & deep, wants_through & heavy_through & deep),
    )
