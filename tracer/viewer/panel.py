"""What a page is told: how to build its panel, and what that shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tracer.scene import Scene
from tracer.viewer.camera import as_toml
from tracer.viewer.controls import Control, usual_step
from tracer.viewer.edits import Rgb, value_at
from tracer.viewer.state import Source, View


def panel_of(
    name: str, scene: Scene, controls: Sequence[Control], choices: Mapping[str, bool], source: Source
) -> dict[str, Any]:
    """What can be changed, and what may be chosen."""
    labels = source.labels
    return {
        "scene": name,
        "resolution": list(scene.camera.resolution),
        "step": usual_step(scene),
        "controls": [control.described() for control in controls],
        "choices": [
            {"name": choice, "label": labels[choice][0], "answers": labels[choice][1:]} for choice in choices
        ],
    }


def values_of(
    view: View, controls: Sequence[Control], choices: Mapping[str, bool], undo: int
) -> dict[str, Any]:
    """The values of all controls, the choices, the camera as TOML, and how many steps can be undone."""
    camera = view.scene.camera
    return {
        "values": {control.name: _value(view.scene, control) for control in controls},
        "choices": dict(choices),
        "layer": view.layer,
        "camera": as_toml(camera),
        "focus": camera.depth_of_field is not None,
        "undo": undo,
        "revision": view.revision,
    }


def _value(scene: Scene, control: Control) -> float | Rgb | None:
    if control.path[-1] == "absorption":
        return scene.materials[str(control.path[1])].absorption
    return value_at(scene, control.path)
