"""The layers that a viewer shows, and the picture of each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tracer.color import quantize
from tracer.film.false_color import false_color, pictures_of
from tracer.film.layout import VISIBILITY
from tracer.film.legend import with_legend
from tracer.film.result import Result
from tracer.scene import Scene

COLOR = "color"

LABELS = {
    COLOR: "color",
    "depth": "depth",
    "normal": "normals",
    "shape": "shape ids",
    "level": "recursion level",
    "rays": "rays a pixel",
}


def names_of(scene: Scene) -> list[tuple[str, str]]:
    """Name and label of every layer of a scene; visibility by light."""
    lights = [
        (f"{VISIBILITY}.light{number}", f"visibility of {light.name or f'light {number}'}")
        for number, light in enumerate(scene.lights)
    ]
    return [*LABELS.items(), *lights]


def aovs_of(layer: str) -> tuple[str, ...]:
    """The layers to render for one, beside color and depth."""
    name = layer.partition(".")[0]
    return () if name in (COLOR, "depth") else (name,)


def picture_of(layer: str, result: Result, legend: bool) -> NDArray[np.uint8]:
    """The picture (h, w, 3) of a layer, with its `legend` where that is asked for and fits."""
    if layer == COLOR:
        return np.asarray(quantize(result.color), np.uint8)
    values = result.depth if layer == "depth" else dict(pictures_of(result.aovs))[layer]
    image = false_color(layer, values)
    return with_legend(image, layer, values) if legend else image
