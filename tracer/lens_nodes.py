"""The nodes of a pixel's tree of rays, made of what is known of the rays of a level."""

from __future__ import annotations

from typing import Any

import numpy as np

from tracer.color import decode_srgb
from tracer.device_meshes import inherited
from tracer.device_scene import DeviceScene, weight_floor
from tracer.lens_lights import name_of, triple
from tracer.ray_tree import EndedRay, HitPoint, LightTerm, RayNode
from tracer.scene import Scene
from tracer.spawn import MaterialRow
from tracer.surface import Surface


class Columns:
    """What is known of the rays of a level, in host memory: (n,) or (n, 3), double precision where real."""

    def __init__(
        self,
        count: int,
        path: Any,
        hit: Any,
        surface: Surface,
        material: MaterialRow,
        own: Any,
        children: Any,
    ) -> None:
        def column(values: Any) -> np.ndarray:
            array = values.numpy()
            array = array.T if array.ndim == 2 else array
            array = np.broadcast_to(array, (count, *array.shape[1:]))
            return array.astype(np.float64) if array.dtype.kind == "f" else array

        self.o, self.d, self.throughput = column(path.o), column(path.d), column(path.throughput)
        self.weight, self.level = column(path.weight), column(path.level)
        self.t, self.primitive, self.valid = column(hit.t), column(hit.primitive), column(hit.valid)
        self.shape, self.p, self.normal = column(surface.shape), column(surface.p), column(surface.normal)
        self.entering = column(surface.entering)
        self.own = column(own)
        self.absorption, self.reflection = column(material.absorption), column(material.reflection)
        self.refraction = column(material.refraction)
        self.diffuse, self.specular = column(material.finish.diffuse), column(material.finish.specular)
        self.reflects, self.refracts = column(children.reflects), column(children.refracts)
        self.total = column(children.total)


class NodesUnderTheLens:
    """Makes the nodes of one pixel; `share`: that of a sub-ray in it."""

    def __init__(self, scene: Scene, device: DeviceScene, share: float) -> None:
        self._scene, self._device, self._share = scene, device, share
        background = np.array(scene.background)
        self._background = decode_srgb(background) if scene.color_space == "linear" else background

    def node(self, kind: str, factor: float, lights: tuple[LightTerm, ...], seen: Columns, i: int) -> RayNode:
        """That of ray i of a level: its kind, its share of its parent, what the lights bring to its hit."""
        worth = seen.throughput[i] * self._share
        node = RayNode(
            kind=kind,
            level=int(seen.level[i]),
            factor=factor,
            weight=float(seen.weight[i]),
            worth=triple(worth),
            origin=triple(seen.o[i]),
            direction=triple(seen.d[i]),
            hit=None,
        )
        if not seen.valid[i]:
            if node.level == 0 or self._scene.secondary_background:
                node.ambient = triple(worth * self._background)
            return node
        hit = node.hit = self._hit_point(seen, i)
        a, lit = self._scene.ambient, worth * hit.color
        direct = (1 - a) * hit.absorption * lit
        node.lights = lights
        node.ambient = triple(a * lit)
        node.diffuse = triple(hit.diffuse * direct * _sum(light.diffuse for light in lights))
        node.specular = triple(hit.specular * direct * _sum(light.specular for light in lights))
        node.ended = tuple(self._ended(node, seen, i))
        return node

    def _hit_point(self, seen: Columns, i: int) -> HitPoint:
        number = int(seen.shape[i])
        shape = self._scene.shapes[number]
        return HitPoint(
            shape=number,
            name=name_of(self._scene, number),
            primitive=int(seen.primitive[i]) - int(self._device.host.first_primitive[number]),
            t=float(seen.t[i]),
            position=triple(seen.p[i]),
            normal=triple(seen.normal[i]),
            entering=bool(seen.entering[i]),
            texture=inherited(self._scene, shape, "texture") or "",
            color=triple(seen.own[i]),
            absorption=float(seen.absorption[i]),
            diffuse=float(seen.diffuse[i]),
            specular=float(seen.specular[i]),
        )

    def _ended(self, node: RayNode, seen: Columns, i: int) -> list[EndedRay]:
        """The children with a share that are not traced."""
        total = bool(seen.total[i])
        ended = []
        for kind, k, traced in (
            ("reflected", seen.reflection[i], seen.reflects[i]),
            ("refracted", seen.refraction[i], seen.refracts[i]),
        ):
            if k == 0 or traced:
                continue
            weight = node.weight * float(k)
            if kind == "refracted" and total and not self._device.options.tir_reflects:
                reason = "total reflection"
            else:
                reason = "cut off" if weight <= weight_floor(self._scene.cutoff) else "too deep"
            ended.append(
                EndedRay("total_reflection" if kind == "refracted" and total else kind, weight, reason)
            )
        return ended


def _sum(terms: Any) -> np.ndarray:
    return np.sum([np.zeros(3), *terms], axis=0)
