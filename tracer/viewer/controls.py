"""What the panel offers of a scene: one control for each number and color that may be changed while it
renders.

A control is named by the path of its value, as for `--set`. All that the page may change of a scene, beside
the camera and the choices, is what is listed here; ranges are kept on this side too.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from tracer.messages import dotted
from tracer.scene import Scene
from tracer.scene_warnings import finite_extents

Path = tuple[str | int, ...]

SHARES = ("reflection", "refraction", "absorption")
"""k_r, k_t and k_a of a material: their sum is 1, whichever one is moved."""

MOST_COLORS = 24
"""Of a texture that have a control: stripes may have thousands."""

_AXES = "xyz"


@dataclass(frozen=True)
class Control:
    """Changes the value at `path`, and stands in a `group` of the panel under a `heading`."""

    path: Path
    group: str
    heading: str
    label: str

    @property
    def name(self) -> str:
        """The path as text, by which the page names the control."""
        return dotted(self.path)

    def described(self) -> dict[str, Any]:
        """What the page must know."""
        return {"name": self.name, "group": self.group, "heading": self.heading, "label": self.label}


@dataclass(frozen=True)
class Swatch(Control):
    """A color, display-referred sRGB as in the scene file."""

    label: str = "color (sRGB)"

    def described(self) -> dict[str, Any]:
        """What the page must know."""
        return super().described() | {"kind": "color"}


@dataclass(frozen=True)
class Slider(Control):
    """A number from `low` to `high`, `logarithmic` or not."""

    low: float
    high: float
    logarithmic: bool = False

    def clipped(self, value: float) -> float:
        """The value within the range."""
        return min(max(value, self.low), self.high)

    def described(self) -> dict[str, Any]:
        """What the page must know."""
        ends = {"low": self.low, "high": self.high, "logarithmic": self.logarithmic}
        return super().described() | {"kind": "number"} | ends


def controls_of(scene: Scene) -> list[Control]:
    """The controls of a scene, in the order of the panel; ranges reach beyond the values that it has."""
    parts = (_scene, _focus, _background, _lights, _materials, _textures, _shapes)
    return [control for part in parts for control in part(scene)]


def _scene(scene: Scene) -> Iterator[Control]:
    yield Slider(("ambient",), "Scene", "", "ambient a", 0.0, 1.0)
    yield Slider(("cutoff",), "Scene", "", "cut-off", min(0.01, scene.cutoff), 1.0, logarithmic=True)


def _focus(scene: Scene) -> Iterator[Control]:
    settings = scene.camera.depth_of_field
    if settings is not None:
        usual = abs(settings.focus)
        yield Slider(
            ("camera", "depth_of_field", "focus"),
            "Scene",
            "",
            "focus",
            usual / 8,
            usual * 8,
            logarithmic=True,
        )


def _background(_: Scene) -> Iterator[Control]:
    yield Swatch(("background",), "Scene", "background")


def _lights(scene: Scene) -> Iterator[Control]:
    largest = max((light.weight for light in scene.lights), default=0.0) or 1.0
    center, reach = _surroundings(scene)
    for number, light in enumerate(scene.lights):
        heading = light.name or f"light {number}"
        place = "position" if light.kind == "point" else "center"
        if len(scene.lights) > 1:  # only the proportions of weights matter
            yield Slider(("lights", number, "weight"), "Lights", heading, "weight", 0.0, 2 * largest)
        yield Swatch(("lights", number, "color"), "Lights", heading)
        for axis, value in enumerate(getattr(light, place)):
            low, high = min(center[axis] - reach, value), max(center[axis] + reach, value)
            path = ("lights", number, place, axis)
            yield Slider(path, "Lights", heading, f"{place} {_AXES[axis]}", low, high)


def _materials(scene: Scene) -> Iterator[Control]:
    for name, material in scene.materials.items():
        ior, shininess = material.ior, material.shininess
        ranges = [
            ("reflection", "reflection k_r", 0.0, 1.0),
            ("refraction", "refraction k_t", 0.0, 1.0),
            ("absorption", "absorption k_a", 0.0, 1.0),
            ("ior", "ior", min(0.5, ior), max(3.0, ior)),
            ("diffuse", "diffuse m", 0.0, max(2.0, 2 * material.diffuse)),
            ("specular", "specular h", 0.0, max(2.0, 2 * material.specular)),
            ("shininess", "shininess s", min(1.0, shininess or 0.1), max(500.0, shininess)),
        ]
        for key, label, low, high in ranges:
            path = ("materials", name, key)
            yield Slider(path, "Materials", name, label, low, high, logarithmic=key == "shininess")


def _textures(scene: Scene) -> Iterator[Control]:
    for name, texture in scene.textures.items():
        interval = getattr(texture, "interval", None)
        if interval is not None:
            path = ("textures", name, "interval")
            yield Slider(path, "Textures", name, "interval", interval / 8, interval * 8, logarithmic=True)
        if hasattr(texture, "color"):
            yield Swatch(("textures", name, "color"), "Textures", name)
        for number in range(min(len(getattr(texture, "colors", ())), MOST_COLORS)):
            yield Swatch(("textures", name, "colors", number), "Textures", name, f"color {number} (sRGB)")


def _shapes(scene: Scene) -> Iterator[Control]:
    """By name where that is one shape's own: another choice may change the numbers."""
    names = Counter(shape.name for shape in scene.shapes)
    for number, shape in enumerate(scene.shapes):
        if shape.color is not None:
            key = shape.name if shape.name and names[shape.name] == 1 else number
            yield Swatch(("shapes", key, "color"), "Shapes", shape.name or f"{shape.kind} {number}")


def usual_step(scene: Scene) -> float:
    """A step of the camera in scene units, by the size of what is there."""
    return float(f"{_surroundings(scene)[1] / 40:.0e}")


def _surroundings(scene: Scene) -> tuple[list[float], float]:
    """The middle of the spheres, meshes and lights, and how far from it a light may go along each axis."""
    points = [points for points, _ in finite_extents(scene).values()]
    points += [
        np.array([getattr(light, "position", getattr(light, "center", None))]) for light in scene.lights
    ]
    if not points:
        return [0.0, 0.0, 0.0], 1.0
    everything = np.concatenate(points)
    low, high = everything.min(axis=0), everything.max(axis=0)
    reach = float((high - low).max()) or 1.0
    rounded = 10.0 ** math.floor(math.log10(reach)) / 2
    return ((low + high) / 2).tolist(), math.ceil(reach / rounded) * rounded
