"""The light that reaches a surface straight from the lights (document, sections 2 and 4): D and H."""

from __future__ import annotations

from typing import Any

from tracer.arrival import NOTHING_WATCHED, DirectLight, Finish, Watch
from tracer.device_scene import DeviceScene
from tracer.few_lights import Shadows, light_of_few
from tracer.many_lights import light_of_many
from tracer.ray import Ray
from tracer.surface import Surface


def direct_light(
    scene: DeviceScene,
    ray: Ray,
    surface: Surface,
    finish: Finish,
    pixel: Any,
    sub_ray: Any,
    active: Any,
    watch: Watch = NOTHING_WATCHED,
    shadows: Shadows | None = None,
) -> DirectLight:
    """The light of all samples that arrives at hits; `shadows`: what is known of them already."""
    if scene.lights.unrolled is None or scene.options.transparent_shadows:
        return light_of_many(scene, ray, surface, finish, pixel, sub_ray, active, watch)
    return light_of_few(scene, ray, surface, finish, scene.lights.unrolled, active, watch, shadows)
