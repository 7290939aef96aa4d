"""What one point light brings to a surface, and what is remembered of all of them (document, section 2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.backends import Backend
from tracer.device_scene import DeviceScene
from tracer.leaving import leave
from tracer.light_tables import LightSample
from tracer.ray import Ray, Segment
from tracer.surface import Surface

VANISHING = -1000
"""Highlights of 2^-1000 and less are none."""


@dataclass
class Finish:
    """The local part of a material at n hits: factors `diffuse` m and `specular` h, exponent `shininess`
    s."""

    diffuse: Any
    specular: Any
    shininess: Any


@dataclass
class Arrival:
    """What one point light would add at n hits: `local` m D + h H before color and shadow, `specular` h H of
    it, mask `lit` where the surface faces it, and the `segment` to the light."""

    local: Any
    specular: Any
    lit: Any
    segment: Segment


@dataclass
class DirectLight:
    """What arrives at n hits: `total` m D + h H (3, n), the number of `shadow_rays` (n,): of samples whose
    light is asked for, also where the answer for a whole light is known at once; `specular`: h H (3, n), a
    list that is empty where nobody asks."""

    total: Any
    shadow_rays: Any
    specular: list[Any]

    @staticmethod
    def none(backend: Backend, width: int, watch: Watch) -> DirectLight:
        """Darkness, in full width."""
        specular = [dr.zeros(backend.Vector3, width)] if watch.specular else []
        return DirectLight(dr.zeros(backend.Vector3, width), dr.zeros(backend.UInt32, width), specular)


@dataclass
class Watch:
    """What layers want to know of the light: whether the highlights by themselves (`specular`), and the share
    of each light's samples that arrives, which is added to `seen`, local memory with a number a light, in
    lanes of the mask `lanes`. `seen` is a list, empty where nobody asks."""

    specular: bool
    seen: list[Any]
    lanes: Any

    def add(self, light: Any, share: Any, active: Any) -> None:
        """Adds to the share of a light."""
        for seen in self.seen:
            lanes = active & self.lanes
            seen.write(seen.read(light, lanes) + share, light, lanes)


NOTHING_WATCHED = Watch(False, [], None)


@dr.syntax
def _power(base: Any, exponent: Any, active: Any) -> Any:
    """base^exponent with 0^0 = 1; a branch, since most packets of lanes have no highlight to raise."""
    result = dr.zeros(type(base), dr.width(active))
    if active:
        binary = exponent * dr.log2(base)
        # Dr.Jit's exponential gives -inf, not 0, where the result leaves the range of double precision.
        power = dr.select(binary > VANISHING, dr.exp2(binary), 0)
        result = dr.select(exponent == 0, 1, power)
    return result


def arrive(scene: DeviceScene, ray: Ray, surface: Surface, finish: Finish, sample: LightSample) -> Arrival:
    """What one point light would add to m D + h H.

    l = (L - p)/|L - p|, r = 2(n.l)n - l, v = -d; both terms are 0 unless n.l > 0 (for a smooth mesh: by its
    geometric normal too) and where the light lies on the shaded point.
    """
    segment = segment_to(ray, surface, sample)
    l = segment.ray.d  # noqa: E741 - the document's letter
    cosine = dr.dot(surface.normal, l)
    lit = (cosine > 0) & (segment.length > 0)
    if scene.smooth is not None:
        lit = lit & (dr.dot(surface.lit_side, l) > 0)
    mirrored = dr.dot(surface.mirrored, l)
    mirrored = dr.select(mirrored > 0, mirrored, 0)
    matters = lit & (finish.specular > 0) & ((mirrored > 0) | (finish.shininess == 0))
    highlight = _power(mirrored, finish.shininess, matters)
    diffuse = cosine if scene.options.diffuse_is_lambert else mirrored
    specular = finish.specular * highlight
    return Arrival(dr.fma(finish.diffuse, diffuse, specular), specular, lit, segment)


def segment_to(ray: Ray, surface: Surface, sample: LightSample) -> Segment:
    """The straight way from the surface to a light."""
    to_light = sample.position - surface.p
    length = dr.sqrt(dr.squared_norm(to_light))
    way = leave(ray, surface, to_light * dr.rcp(length), crosses=False)
    return Segment(way, length, sample.position, sample.sides, sample.decided)
