"""Which scenes a run compares."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import tracer
from reference.random_scenes import random_scene
from tracer.assets import builtin_scenes
from tracer.errors import UsageError

STANDARD = (
    "room",
    "classic",
    "optics_glass",
    "optics_total_reflection",
    "shape_instance",
    "shape_smooth",
)
"""Scenes of a run that names none: every kind of shape and event, area lights, pictures; within a minute."""

STANDARD_RANDOM, FULL_RANDOM = 2, 16
"""Random scenes of a run that asks for no number of them."""

STANDARD_RAYS, FULL_RAYS = 20_000, 200_000
"""Rays of a scene; with those of all scenes a full run asks more than ten million."""


@dataclass(frozen=True)
class Subject:
    """A scene to compare in, and the words of a command line that name it."""

    scene: tracer.Scene
    words: str


def chosen_scenes(
    names: Sequence[str],
    full: bool,
    random: int | None,
    seed: int,
    load: Callable[[str], tracer.Scene] = tracer.load,
) -> list[Subject]:
    """The scenes of a run: those named; with `full` all that are built in; random ones from `seed` on; and
    without any wish the standard set. Raises `SceneError`, `UsageError` for two scenes of one name."""
    alone = not names and random is not None and not full
    if full:
        names = list(dict.fromkeys([*builtin_scenes(), *names]))
        random = FULL_RANDOM if random is None else random
    elif not names and not alone:
        names, random = STANDARD, STANDARD_RANDOM
    subjects = [Subject(load(name), shlex.quote(name)) for name in names]
    subjects += [random_subject(seed + k) for k in range(random or 0)]
    known: set[str] = set()
    for subject in subjects:
        if subject.scene.name in known:
            raise UsageError(
                f"{subject.words}: another scene is called {subject.scene.name!r} as well; allowed are "
                "scenes of different names"
            )
        known.add(subject.scene.name)
    return subjects


def random_subject(seed: int) -> Subject:
    """A random scene by its number."""
    return Subject(random_scene(seed), f"--random 1 --seed {seed}")
