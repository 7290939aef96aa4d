"""What drafts leave out, and what is made ready for them, so that no kernel is compiled while a slider moves.

Two numbers of a scene stand in its kernels (docs/architecture.md, "Precision and backends"): whether a light
has weight at all, and, in a few steps, the cut-off, which decides how many rays can wait. A draft keeps the
structure that the scene had when it was loaded; the picture at rest is exact.
"""

from __future__ import annotations

import itertools

import numpy as np

from tracer.backends import find_backend
from tracer.device_scene import stack_entries
from tracer.render import render
from tracer.scene import Scene
from tracer.scene.contents import snapshot

UNSEEN = 1e-6
"""Weight of a light without weight, as a share of all weights: below half a step of eight bits."""

TINY, FAR_FROM_FOCUS = 16, 1e9
"""Columns of a picture, and how much too far away a focus is, to have the filter at its largest windows."""

ALIGNMENT = 128
"""Bytes from which on Dr.Jit takes memory for aligned, at the widest vectors."""


def draft_of(scene: Scene, loaded: Scene) -> Scene:
    """The scene with the structure of the one that was loaded; the scene itself where that is its own."""
    dark = [
        number
        for number, (light, before) in enumerate(zip(scene.lights, loaded.lights, strict=False))
        if light.weight == 0 and before.weight > 0
    ]
    depth = scene.max_depth
    deep = stack_entries(scene.cutoff, depth) != stack_entries(loaded.cutoff, depth)
    if not (dark or deep):
        return scene
    twin = snapshot(scene)
    for number in dark:
        twin.lights[number].weight = UNSEEN * (sum(light.weight for light in scene.lights) or 1.0)
    if deep:
        twin.cutoff = loaded.cutoff
    return twin


def compile_copies(backend: str) -> None:
    """Compiles the small kernels that copy tables into Dr.Jit's memory: which of them a change needs depends
    on where NumPy's memory happens to lie."""
    for precision in ("single", "double"):
        types = find_backend(backend, precision)
        for upload, kind in ((types.table, types.dtype), (types.id_table, np.uint32)):
            room = np.zeros(256, kind)
            start = -room.ctypes.data % ALIGNMENT // room.itemsize
            for shift, count in itertools.product((0, 1), (1, 64)):
                upload(room[start + shift :][:count])


def compile_filters(scene: Scene, backend: str) -> None:
    """Compiles both forms of the depth-of-field filter, for small windows and for large ones: a focus that
    moves goes from one to the other."""
    settings = scene.camera.depth_of_field
    if settings is None:
        return
    tiny = snapshot(scene)
    for focus in (settings.focus, FAR_FROM_FOCUS * settings.focus):
        settings = settings.model_copy(update={"focus": focus})
        tiny.camera = scene.camera.model_copy(update={"depth_of_field": settings})
        render(tiny, backend=backend, supersample=1, scale=TINY / scene.camera.resolution[0])
