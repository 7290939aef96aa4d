"""The term of placement: what kernels are given of shapes and lights, against the plain version's reading.

All other terms compare what tracers do with the same numbers; this one says that the numbers are right.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import tracer
from reference.comparison.case import Case
from reference.comparison.judge import SINGLE
from reference.comparison.kinds import has_shapes
from reference.comparison.records import Outcome, Term
from reference.comparison.truth import MESH, PLANE, Truth
from reference.tolerances import EPSILON, TOLERANCES
from tracer.backends import find_backend
from tracer.device_scene import DeviceScene, compile_scene
from tracer.lights import AreaLight, LightRecord

Array = np.ndarray

GOLDEN_ANGLE = np.pi * (3 - 5**0.5)
"""Between the samples of a disk or sphere (document, section 4)."""


@dataclass(frozen=True)
class Difference:
    """The largest difference of an entry, in its unit, and what it is."""

    size: float
    what: str


def compare_placement(case: Case) -> Outcome:
    """Planes, spheres, triangles and light samples in the tables of the device: the largest difference of a
    coordinate in eps S, infinite where something is missing."""
    scene = case.scene.model_copy(update={"lights": still_lights(case.scene)})
    truth = Truth.of(scene)
    device = compile_scene(scene, find_backend(case.backend, case.precision))
    largest = (float(np.abs(table).max(initial=0)) for table in (truth.rows, truth.lights))
    extent = max(truth.extent, *largest)
    unit = case.epsilon * max(extent, 1e-300)
    found = [*_shapes(truth, device, unit, extent), _lights(truth, device, unit)]
    worst = max(found, key=lambda each: each.size)
    allowed = TOLERANCES["placement"].value
    return Outcome(
        term="placement",
        scene=case.scene.name,
        precision=case.precision,
        backend=case.backend,
        rays=len(truth.kind) + len(truth.corners) + len(truth.lights),
        measured=worst.size,
        allowed=allowed,
        unit="eps S",
        ours_error=worst.size,
        ours_allowed=allowed,
        guilty="ours" if worst.size > allowed else "",
        figures={f"largest: {worst.what}": worst.size},
    )


def still_lights(scene: tracer.Scene) -> list[LightRecord]:
    """The lights that shine, without jitter: it moves samples from pixel to pixel."""
    return [
        light.model_copy(update={"jitter": False}) if isinstance(light, AreaLight) else light
        for light in scene.lights
        if light.weight > 0
    ]


def _shapes(truth: Truth, device: DeviceScene, unit: float, extent: float) -> list[Difference]:
    rows = device.geometry.numpy().astype(np.float64).reshape(-1, 4)
    found = []
    for number, kind in enumerate(truth.kind):
        if kind == MESH:
            corners = truth.corners[truth.first[number] : truth.first[number + 1]]
            own = device.host.meshes[number].corners if number in device.host.meshes else corners[:0]
            found.append(_difference(own, corners, SINGLE * extent, f"triangles of shape {number}"))
            continue
        scale = (
            np.array([extent, extent, extent, 1.0]) if kind == PLANE else np.ones(4)
        )  # a normal has no unit
        found.append(_difference(rows[number] * scale, truth.rows[number] * scale, unit, f"shape {number}"))
    return found


def _lights(truth: Truth, device: DeviceScene, unit: float) -> Difference:
    count = int(device.lights.count.numpy()[0])
    own = device.lights.rows.numpy().astype(np.float64).reshape(max(1, count), -1)[:count, :3]
    if not count or len(own) != len(truth.lights):
        return _difference(own, truth.lights, unit, "light samples")
    ends = truth.first_light[1:-1]
    parts = zip(np.split(own, ends), np.split(truth.lights, ends), strict=True)
    found = [_light(mine, true, unit, number) for number, (mine, true) in enumerate(parts)]
    return max(found, key=lambda each: each.size)


def _light(own: Array, true: Array, unit: float, number: int) -> Difference:
    """Samples lie at multiples of the golden angle, and the angle of sample k is known to eps times k turns:
    that counts beside S."""
    radius = np.linalg.norm(true - true.mean(axis=0), axis=1).max(initial=0)
    turned = np.arange(len(true)) * GOLDEN_ANGLE * radius * EPSILON["double"]
    return Difference(float((np.abs(own - true).max(axis=1) / (unit + turned)).max()), f"light {number}")


def _difference(own: Array, true: Array, unit: float, what: str) -> Difference:
    if own.shape != true.shape:
        return Difference(float("inf"), f"{what}: {len(own)} in place of {len(true)}")
    return Difference(float(np.abs(own - true).max(initial=0)) / unit, what)


def terms() -> list[Term]:
    """The one term."""
    return [Term("placement", "shapes and lights as the kernels get them", has_shapes, compare_placement)]
