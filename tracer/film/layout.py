"""The names under which the parts of a result stand in an OpenEXR file (interface, OpenEXR layout)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from tracer.color import decode_srgb

RGB, XYZ = ("R", "G", "B"), ("X", "Y", "Z")
COMPONENTS: dict[str, tuple[str, ...]] = {
    "normal": XYZ,
    "Ng": XYZ,
    "position": XYZ,
    "uv": ("U", "V"),
    "ambient": RGB,
    "diffuse": RGB,
    "specular": RGB,
    "reflected": RGB,
    "refracted": RGB,
}
IDS = frozenset({"shape", "primitive"})
INTEGERS = dict.fromkeys(IDS, np.int32) | dict.fromkeys(("level", "rays"), np.uint32)
"""Layers of whole numbers, and their types."""

VISIBILITY = "visibility"
"""Has a component for each light, also where there is only one."""


def component_count(name: str, lights: int) -> int:
    """How many numbers a layer has in each pixel."""
    return lights if name == VISIBILITY else len(COMPONENTS.get(name, ("",)))


def color_channels(color: NDArray, alpha: NDArray) -> dict[str, NDArray]:
    """R, G, B scene-linear, decoded from display-referred `color` (h, w, 3), and A = coverage (h, w)."""
    channels: dict[str, NDArray] = {name: decode_srgb(color[..., k]) for k, name in enumerate(RGB)}
    return channels | {"A": alpha}


def aov_channels(aovs: Mapping[str, NDArray]) -> dict[str, NDArray]:
    """One channel (h, w) for each component of each AOV: normal.X, uv.U, visibility.light0, shape ...

    Ids stay whole numbers (-1 is blank), everything else becomes float32. An AOV that is not listed in
    `COMPONENTS` keeps its name, and its components are numbered from 0.
    """
    channels: dict[str, NDArray] = {}
    for name, values in aovs.items():
        if name == "depth":  # a channel of every file
            continue
        stored = values if name in IDS else values.astype(np.float32, copy=False)
        if stored.ndim == 2:
            channels[name] = stored
            continue
        for k, component in enumerate(component_names(name, stored.shape[2])):
            channels[f"{name}.{component}"] = stored[..., k]
    return channels


def component_names(name: str, count: int) -> tuple[str, ...]:
    """The names of the `count` components of a layer."""
    if name == VISIBILITY:
        return tuple(f"light{k}" for k in range(count))
    return COMPONENTS.get(name) or tuple(str(k) for k in range(count))
