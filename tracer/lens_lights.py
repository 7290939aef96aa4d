"""What the lights do at the hits of a pixel's tree: each of them by itself, and what hides it."""

from __future__ import annotations

from collections import Counter
from typing import Any

import drjit as dr
import numpy as np

from tracer.arrival import Finish, arrive
from tracer.backends import INVALID
from tracer.device_scene import DeviceScene
from tracer.intersection import closest_hit
from tracer.light_tables import fetch_ball, fetch_sample, jitter_shift
from tracer.many_lights import plane_bits_of
from tracer.occlusion import hidden, transmittance
from tracer.ray_tree import LightTerm, Triple
from tracer.replay import put_together, take_apart
from tracer.scene import Scene
from tracer.spawn import MaterialRow
from tracer.surface import Surface
from tracer.suspects import find_suspects


class LightsUnderTheLens:
    """The lights of a scene."""

    def __init__(self, scene: Scene, device: DeviceScene) -> None:
        self._scene, self._device = scene, device
        self._samples = int(device.lights.count.numpy()[0])
        self._owners = device.lights.lights.numpy()[: self._samples]

    def terms(
        self,
        rays: int,
        path: Any,
        surface: Surface,
        material: MaterialRow,
        found: Any,
        pixel: Any,
        sub_ray: Any,
    ) -> list[tuple[LightTerm, ...]]:
        """The terms of all lights at the hits of the first `rays` lanes; every pair of a hit and a sample has
        a lane. `pixel` and `sub_ray` (n,): the numbers by which lights jitter."""
        count, samples = len(sub_ray), self._samples
        if samples == 0:
            return [()] * rays
        upload = self._device.backend.id_table
        of_ray, i = upload(np.repeat(np.arange(count), samples)), upload(np.tile(np.arange(samples), count))
        hits = (path, surface, material.finish.shininess, found, pixel, sub_ray)
        arrived = self._arrivals(picked(hits, of_ray), i)
        shape = (count, samples)
        facing, share, blocker = (
            arrived[name].numpy().reshape(shape) for name in ("facing", "share", "blocker")
        )
        terms = {name: arrived[name].numpy().T.reshape(*shape, 3) for name in ("diffuse", "specular")}
        return [
            tuple(
                self._term(light, facing[ray, own], share[ray, own], blocker[ray, own], terms, (ray, own))
                for light in dict.fromkeys(self._owners.tolist())
                for own in [np.flatnonzero(self._owners == light)]
            )
            for ray in range(rays)
        ]

    def _term(
        self, light: int, facing: Any, share: Any, blocker: Any, terms: dict[str, Any], where: Any
    ) -> LightTerm:
        shapes = self._device.host.first_primitive
        hiding = Counter(
            name_of(self._scene, int(np.searchsorted(shapes, primitive, "right")) - 1)
            for primitive in blocker[blocker != INVALID].tolist()
        )
        return LightTerm(
            light=light,
            kind=self._scene.lights[light].kind,
            samples=len(facing),
            facing=int(facing.sum()),
            share=float(share.mean()),
            diffuse=triple(terms["diffuse"][where].astype(np.float64).sum(axis=0)),
            specular=triple(terms["specular"][where].astype(np.float64).sum(axis=0)),
            hidden_by=tuple(hiding.most_common()),
        )

    def _arrivals(self, hits: tuple[Any, ...], i: Any) -> dict[str, Any]:
        """What sample i of the lights brings to hits, as a render finds it, and the primitive that hides
        it."""
        path, surface, shininess, found, pixel, sub_ray = hits
        device, lights = self._device, self._device.lights
        backend = device.backend
        width = len(i)
        number = dr.gather(backend.UInt32, lights.lights, i)
        shift = dr.zeros(backend.Vector2, width)
        if lights.jitter:
            shift = jitter_shift(backend, lights, number, pixel, sub_ray)
        sample, color, _ = fetch_sample(backend, lights, i, shift, lambda p: plane_bits_of(device, p))
        one, none = dr.full(backend.Float, 1, width), dr.zeros(backend.Float, width)
        diffuse, specular = (
            arrive(device, path.ray, surface, finish, sample)
            for finish in (Finish(one, none, shininess), Finish(none, one, shininess))
        )
        facing, segment = found & diffuse.lit, diffuse.segment
        ball = fetch_ball(backend, lights, number)
        who = find_suspects(device, surface, ball, found, spheres=True, beams=lights.areas)
        if device.options.transparent_shadows:
            share = transmittance(device, segment, surface, who, facing)
        else:
            share = dr.select(hidden(device, segment, surface, who, facing), backend.Float(0), 1)
        share = dr.select(facing, share, 0)
        dimmed = facing & (share < 1)
        blocker = closest_hit(device, segment.ray, dimmed, t_max=segment.length).primitive
        result = {
            "facing": facing,
            "share": share,
            "blocker": dr.select(dimmed, blocker, INVALID),
            "diffuse": share * diffuse.local * color,
            "specular": share * specular.local * color,
        }
        dr.eval(result)
        return result


def name_of(scene: Scene, shape: int) -> str:
    """The name of a shape, or its kind and number."""
    found = scene.shapes[shape]
    return found.name or f"{found.kind} {shape}"


def picked(tree: Any, index: Any) -> Any:
    """The lanes `index` of all arrays of a tree of records; numbers of width 1 stay as they are."""
    arrays: list[Any] = []
    structure = take_apart(tree, arrays)
    dr.eval(arrays)
    return put_together(structure, iter([a if len(a) == 1 else dr.gather(type(a), a, index) for a in arrays]))


def triple(values: Any) -> Triple:
    """Three Python numbers."""
    x, y, z = (float(value) for value in values)
    return x, y, z
