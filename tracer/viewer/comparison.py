"""The view as Mitsuba's hits and the document's formula give it, beside ours.

One of the few places of `tracer` that see `reference`, inside the function alone: Mitsuba need not be there.
"""

from __future__ import annotations

import base64
import importlib.util
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracer.canvas import Canvas
from tracer.color import quantize
from tracer.film.png import encode_png
from tracer.render import render
from tracer.scene import Scene
from tracer.scene.contents import snapshot
from tracer.viewer.camera import on_canvas

LARGEST = 640
"""Columns of the compared pictures at most."""

ENLARGED = 32
"""How much brighter than it is the difference is shown."""


def is_available() -> bool:
    """Whether Mitsuba is installed."""
    return (
        importlib.util.find_spec("mitsuba") is not None and importlib.util.find_spec("reference") is not None
    )


def compared(scene: Scene, backend: str) -> dict[str, Any]:
    """Our picture, Mitsuba's and their difference, as PNG in data URLs; the largest difference and the RMS.

    One ray a pixel, without depth of field, which the reference leaves out. Raises `MachineError` without
    Mitsuba.
    """
    from reference import whitted

    small = _small(scene)
    ours = np.asarray(render(small, backend=backend, supersample=1, aovs=()).color)
    theirs = np.asarray(whitted.render(small, supersample=1).color)
    difference = np.abs(ours.astype(np.float64) - theirs)
    return {
        "ours": _url(ours),
        "theirs": _url(theirs),
        "difference": _url(ENLARGED * difference),
        "enlarged": ENLARGED,
        "largest": float(difference.max()),
        "rms": float(np.sqrt(np.mean(difference**2))),
        "visible": int(np.any(quantize(ours) != quantize(theirs), axis=2).sum()),
        "pixels": difference.shape[0] * difference.shape[1],
    }


def _small(scene: Scene) -> Scene:
    """The scene at the size of the comparison."""
    twin, camera = snapshot(scene), scene.camera
    canvas = Canvas.of(camera, scene.literal).scaled(min(1.0, LARGEST / camera.resolution[0]))
    twin.camera = on_canvas(camera, canvas, depth_of_field=None)
    return twin


def _url(image: NDArray) -> str:
    return "data:image/png;base64," + base64.b64encode(encode_png(image)).decode()
