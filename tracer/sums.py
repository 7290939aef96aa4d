"""What layers add up along a pixel's tree of rays: the parts of the light, the share of each light that
arrives (document, section 2).

A layer is structure: a kernel holds the sums that are asked for, and without any it is the kernel of the
plain picture.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.arrival import Watch
from tracer.backends import Backend
from tracer.branches import changed_where
from tracer.device_scene import DeviceScene
from tracer.film.layout import VISIBILITY

TERMS = ("diffuse", "specular")
BRANCHES = ("reflected", "refracted")
PARTS = ("ambient", *TERMS, *BRANCHES)
"""The parts of the light; they add up to the color."""


@dataclass
class Sums:
    """`parts`: sums (3, n) over the sub-rays, by name; `seen`: local memory with a number a light, a list
    that is empty where nobody asks; `mirrored`: whether the ray in hand stems from the mirrored child of
    the primary ray, a list alike."""

    parts: dict[str, Any]
    seen: list[Any]
    mirrored: list[Any]

    @staticmethod
    def zero(scene: DeviceScene, names: Sequence[str], width: int) -> Sums:
        """The sums that these layers need."""
        backend = scene.backend
        seen = [_zeros(backend, scene.lights.number)] if VISIBILITY in names else []
        branches = any(name in names for name in BRANCHES)
        return Sums(
            parts={name: dr.zeros(backend.Vector3, width) for name in PARTS if name in names},
            seen=seen,
            mirrored=[dr.zeros(backend.Bool, width)] if branches else [],
        )

    def watch(self, lanes: Any) -> Watch:
        """What is to be known of the direct light, in lanes where it is that of a primary ray."""
        return Watch(any(name in self.parts for name in TERMS), self.seen, lanes)

    def with_light(self, is_primary: Any, own: Callable[[], Mapping[str, Any]], whole: Any) -> Sums:
        """The sums with what a ray brings: of a primary ray by part (`own` gives them, and is not asked where
        a packet has no such ray), of another the `whole` of it, for the branch in which it stands."""

        def with_own(totals: dict[str, Any]) -> dict[str, Any]:
            found = own()
            return {name: total + found[name] for name, total in totals.items()}

        parts = dict(self.parts)
        firsts = {name: total for name, total in parts.items() if name not in BRANCHES}
        if firsts:
            parts |= changed_where(is_primary, firsts, with_own, label="own light")
        for name in [name for name in BRANCHES if name in parts]:
            (mirrored,) = self.mirrored
            lanes = ~is_primary & (mirrored if name == "reflected" else ~mirrored)
            parts[name] = parts[name] + dr.select(lanes, whole, 0)
        return Sums(parts, self.seen, self.mirrored)

    def with_next(self, level: Any, refracts: Any) -> Sums:
        """The sums when the loop has chosen its next ray, of that `level`. A ray of level 1 is the refracted
        child in hand (`refracts`) or the mirrored one, in hand or from the stack."""
        turns = [dr.select(level == 1, ~refracts, mirrored) for mirrored in self.mirrored]
        return Sums(self.parts, self.seen, turns)

    def layers(self, hits: Any, share: Any, lights: int) -> dict[str, Any]:
        """The layers: means over the sub-rays (`share` is the weight of one), of the visibility over those
        that hit something, NaN where none does."""
        found: dict[str, Any] = {name: total * share for name, total in self.parts.items()}
        for seen in self.seen:
            index = type(hits)
            values = [seen.read(index(light)) for light in range(lights)]
            number = type(share)(hits)
            found[VISIBILITY] = [dr.select(hits > 0, value / number, float("nan")) for value in values]
        return found


def _zeros(backend: Backend, count: int) -> Any:
    """Local memory of so many numbers, written one by one (`alloc_local` with zeros may call a function that
    is not there)."""
    memory = dr.alloc_local(backend.Float, count)
    for k in range(count):
        memory.write(backend.Float(0), backend.UInt32(k))
    return memory
