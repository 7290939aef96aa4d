"""Which scenes a run compares."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import tracer
from reference.random_scenes import random_scene
from tracer.assets import builtin_scenes

STANDARD = (
    "room",
    "classic",
    "optics_glass",
    "optics_total_reflection",
    "shape_instance",
    "shape_smooth",
    "light_disk",
    "texture_image",
)
"""Scenes of a run that names none: every kind of shape, light and event, in about half a minute."""

STANDARD_RANDOM, FULL_RANDOM = 2, 16
"""Random scenes of a run that asks for no number of them."""

STANDARD_RAYS, FULL_RAYS = 20_000, 200_000
"""Rays of a scene; with those of all scenes a full run asks more than ten million."""


def chosen_scenes(
    names: Sequence[str],
    full: bool,
    random: int | None,
    seed: int,
    load: Callable[[str], tracer.Scene] = tracer.load,
) -> list[tracer.Scene]:
    """The scenes of a run: those named; with `full` all that are built in; random ones from `seed` on; and
    without any wish the standard set. Raises `SceneError`."""
    alone = not names and random is not None and not full
    if full:
        names = list(dict.fromkeys([*builtin_scenes(), *names]))
        random = FULL_RANDOM if random is None else random
    elif not names and not alone:
        names, random = STANDARD, STANDARD_RANDOM
    return [load(name) for name in names] + [random_scene(seed + k) for k in range(random or 0)]
