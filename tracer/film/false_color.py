"""Layers as colors for the eye: which map, over which range, and what is blank."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from tracer.color import encode_srgb, quantize
from tracer.film.layout import COMPONENTS, IDS, RGB, VISIBILITY, component_names

BLANK = (128, 128, 128)
"""Where a layer holds nothing: -1, NaN, infinity. A color that no map has, and no normal."""

WIDE = 8.0
"""From this multiple of the median on, the largest distance makes a scale logarithmic: where a floor reaches
to the horizon, all else would have one color."""

DECADES = 3.0
"""What a logarithmic scale covers at most; below, all has its first color."""

DISTANCES = frozenset({"depth", "z"})
DIRECTIONS = frozenset({"normal", "Ng"})
LIGHT = frozenset(name for name, components in COMPONENTS.items() if components == RGB)
MAPS = {
    "depth": cv2.COLORMAP_VIRIDIS,
    "z": cv2.COLORMAP_VIRIDIS,
    "level": cv2.COLORMAP_PLASMA,
    "rays": cv2.COLORMAP_PLASMA,
    VISIBILITY: cv2.COLORMAP_INFERNO,
}
"""Color maps of even steps for the eye."""


@dataclass(frozen=True)
class Scale:
    """The range of a layer's values, or of one component's; `name` is the component's, or empty."""

    name: str
    low: float
    high: float
    logarithmic: bool = False

    def place(self, values: NDArray) -> NDArray[np.float64]:
        """Where values lie, from 0 for the lowest to 1 for the highest."""
        exact = values.astype(np.float64)
        if self.high == self.low:
            return np.zeros(exact.shape)
        if not self.logarithmic:
            return (exact - self.low) / (self.high - self.low)
        first = max(self.low, self.high / 10**DECADES)
        return np.asarray(np.log(np.maximum(exact, first) / first) / np.log(self.high / first))


def false_color(layer: str, values: NDArray, linear: bool = False) -> NDArray[np.uint8]:
    """The picture (h, w, 3), red first, of a layer (h, w) or (h, w, components).

    Distances, counts and visibility by a color map; directions as (n + 1)/2; positions and coordinates with a
    primary color for each component; ids in colors of their own; light as it is, up to 1.

    `layer`: a name from `docs/layers.md`, with values (h, w) also that of a component (visibility.light0).
    `linear`: parts of the light are in linear values (`Result.color_space`).
    """
    name = _layer_of(layer)
    if name in LIGHT:
        return np.asarray(quantize(encode_srgb(values) if linear else values), np.uint8)
    blank, scales = blank_of(layer, values), scales_of(layer, values)
    clean = np.where(blank if values.ndim == 2 else blank[..., None], 0, values)
    image = np.zeros((*blank.shape, 3), np.uint8)
    if name in IDS:
        image = id_colors(clean)
    elif values.ndim == 3:
        for k, scale in enumerate(scales):
            image[..., k] = quantize(scale.place(clean[..., k]))
    elif scales:
        image = color_map(layer)[quantize(scales[0].place(clean))]
    image[blank] = BLANK
    return image


def blank_of(layer: str, values: NDArray) -> NDArray[np.bool_]:
    """Mask (h, w): where a layer holds nothing."""
    missing = ~np.isfinite(values if values.ndim == 2 else values.sum(axis=2))
    return missing | (values < 0) if _layer_of(layer) in DISTANCES | IDS else missing


def scales_of(layer: str, values: NDArray) -> list[Scale]:
    """The range that the colors of a layer stand for, or that of each component; none if all is blank.

    Light has the range of its components together, though colors end at 1.
    """
    name = _layer_of(layer)
    found = values[~blank_of(layer, values)]
    if not found.size:
        return []
    if name == VISIBILITY:
        return [Scale("", 0, 1)]
    if name in DIRECTIONS:
        return [Scale(component, -1, 1) for component in COMPONENTS[name]]
    if found.ndim == 2 and name not in LIGHT:
        columns = zip(COMPONENTS[name], found.T, strict=True)
        return [Scale(component, float(column.min()), float(column.max())) for component, column in columns]
    low, high = float(found.min()), float(found.max())
    return [Scale("", low, high, name in DISTANCES and high > WIDE * float(np.median(found)))]


def id_colors(numbers: NDArray[np.integer]) -> NDArray[np.uint8]:
    """A color (..., 3) for each id: the hue goes on by the golden ratio, saturation and value take turns, so
    near ids differ much, and no color depends on how many ids there are."""
    whole = numbers.astype(np.uint64)
    hue = whole * np.uint64(0x9E3779B97F4A7C15) >> np.uint64(56)  # 2^64 over the golden ratio, modulo 2^64
    saturation, value = 230 - 80 * (whole // 3 % 2), 255 - 60 * (whole % 3)
    hsv = np.stack((hue, saturation, value), axis=-1).astype(np.uint8)
    return np.asarray(cv2.cvtColor(hsv.reshape(-1, 1, 3), cv2.COLOR_HSV2RGB_FULL)).reshape(hsv.shape)


@cache
def color_map(layer: str) -> NDArray[np.uint8]:
    """The colors (256, 3) of a layer that has one number a pixel, from the lowest to the highest."""
    steps = np.arange(256, dtype=np.uint8)[:, None]
    return np.ascontiguousarray(cv2.applyColorMap(steps, MAPS[_layer_of(layer)])[:, 0, ::-1])


def picture_names(layers: Iterable[str], lights: int) -> list[str]:
    """The names of the pictures of layers: the visibility has one for each light, and none without lights."""
    parts = [f"{VISIBILITY}.{component}" for component in component_names(VISIBILITY, lights)]
    return [name for layer in layers for name in (parts if layer == VISIBILITY else [layer])]


def pictures_of(layers: Mapping[str, NDArray]) -> Iterator[tuple[str, NDArray]]:
    """Layers by name, as `false_color` takes them, under their `picture_names`."""
    for layer, values in layers.items():
        if layer == VISIBILITY:
            lights = values.shape[2]
            yield from zip(picture_names([layer], lights), np.moveaxis(values, 2, 0), strict=True)
        else:
            yield layer, values


def _layer_of(name: str) -> str:
    return name.split(".")[0]
