"""How strong the lights of an exported scene have to be: small pictures by both renderers tell."""

from __future__ import annotations

from typing import Any

import numpy as np

import tracer
from reference.adapters import sensor_of
from reference.adapters.plugins import sensor_plugin
from reference.mitsuba_variant import mitsuba
from tracer.canvas import Canvas
from tracer.color import decode_srgb

LARGEST_SIDE = 48
SUBPIXELS = 4


def light_strength(scene: tracer.Scene, exported: Any) -> float:
    """The factor of all lights with which the exported mi.Scene is as bright as the model's picture.

    Light that falls off and bounces on has no counterpart in the model, so no formula gives it: it is the
    median over the pixels of a small picture, and 1 where nothing can be compared.
    """
    mi = mitsuba()
    scale = min(1.0, LARGEST_SIDE / max(scene.camera.resolution))
    canvas = Canvas.of(scene.camera, scene.literal).scaled(scale)
    sensor = sensor_plugin(mi, sensor_of(scene.camera, canvas, 1.0, SUBPIXELS))
    there = mi.render(exported, sensor=sensor, spp=SUBPIXELS**2).numpy().mean(axis=2)
    picture = tracer.render(scene, scale=scale, supersample=1).color
    here = decode_srgb(np.clip(picture, 0, 1)).mean(axis=2)
    lit = (there > 0) & (here > 0) & np.isfinite(there)
    return float(np.median(here[lit] / there[lit])) if lit.any() else 1.0
