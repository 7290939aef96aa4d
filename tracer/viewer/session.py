"""What a viewer shows: the scene as it was edited, the camera, the layer, and the way back.

A `Session` is changed by the page's messages and read by the renderer's thread; it knows neither of them.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

from tracer.camera import Camera, DepthOfField
from tracer.errors import SceneError
from tracer.records import parse_color
from tracer.scene import Scene
from tracer.scene.contents import snapshot
from tracer.viewer import camera as moves
from tracer.viewer.controls import Control, Slider, Swatch, controls_of
from tracer.viewer.edits import applied, consequences
from tracer.viewer.panel import panel_of, values_of
from tracer.viewer.state import Source, State, View
from tracer.viewer.steering import Steering

Kind = TypeVar("Kind", bound=Control)

MOST_UNDONE = 200
"""Steps that can be undone."""


class Session(Steering):
    """The edited scene. All methods may be called from any thread; `on_change` is told of every change."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._lock = threading.RLock()
        self._choices = dict(source.choices)
        self._base = source.load(self._choices)
        self._state = State(self._choices, {}, self._base.camera)
        self._undo: list[State] = []
        self._gesture: object = None
        self._view = View(self._base, "color", 0, 0.0, 0.0)
        super().__init__(self._base.camera)
        self.controls = controls_of(self._base)
        self.on_change: Callable[[], None] = lambda: None
        self._rebuild(self._state)

    # ---- What is to be seen ----

    @property
    def view(self) -> View:
        """What is wanted now."""
        return self._view

    @property
    def camera(self) -> Camera:
        """Its camera."""
        return self._state.camera

    @property
    def name(self) -> str:
        """The scene's name."""
        return self._base.name

    def described(self) -> dict[str, Any]:
        """The panel: what can be changed, and what may be chosen."""
        with self._lock:
            return panel_of(self.name, self._view.scene, self.controls, self._state.choices, self._source)

    def values(self) -> dict[str, Any]:
        """What the panel shows."""
        with self._lock:
            return values_of(self._view, self.controls, self._state.choices, len(self._undo))

    # ---- What changes it ----

    def set(self, name: str, value: float, gesture: object = None, stamp: float = 0.0) -> None:
        """Moves a slider; raises `SceneError` for one that there is not, or a value that is refused."""
        with self._lock:
            control = self._control(name, Slider)
            value = control.clipped(value)
            if control.path[0] == "camera":
                settings = self._state.camera.depth_of_field
                assert settings is not None
                sharp = settings.model_copy(update={"focus": value})
                self._go(self._with_camera(depth_of_field=sharp), gesture, stamp)
                return
            edits = self._state.edits | consequences(self._view.scene, control.path, value)
            self._go(replace(self._state, edits=edits), gesture, stamp)

    def paint(self, name: str, color: str, gesture: object = None, stamp: float = 0.0) -> None:
        """Sets a color, `#rrggbb`; raises `SceneError` for one that has no control."""
        with self._lock:
            path = self._control(name, Swatch).path
            edits = self._state.edits | {path: parse_color(color)}
            self._go(replace(self._state, edits=edits), gesture, stamp)

    def _control(self, name: str, kind: type[Kind]) -> Kind:
        for control in self.controls:
            if control.name == name and isinstance(control, kind):
                return control
        raise SceneError(f"{self.name}: there is no control `{name[:80]}`")

    def choose(self, name: str, value: bool, stamp: float = 0.0) -> None:
        """Answers one of the document's questions anew; edits and camera stay, but for a camera that is
        asked for."""
        with self._lock:
            if name not in self._state.choices:
                raise SceneError(f"{self.name}: there is no choice `{name[:80]}`")
            choices = self._state.choices | {name: value}
            base = self._source.load(choices)
            camera = self._state.camera
            if (base.camera.rotate, base.camera.position) != (
                self._base.camera.rotate,
                self._base.camera.position,
            ):
                camera = base.camera.model_copy(update={"depth_of_field": camera.depth_of_field})
            self._go(State(choices, self._state.edits, camera), None, stamp, base)

    def reload(self, stamp: float = 0.0) -> None:
        """Reads the scene anew; edits stay, and a camera that was moved. Raises `SceneError` and changes
        nothing where the file is refused."""
        with self._lock:
            base = self._source.load(self._choices)
            moved = self._state.camera != self._base.camera
            camera = self._state.camera if moved else base.camera
            self._rebuild(replace(self._state, camera=camera), stamp, base)
        self.on_change()

    def move(self, change: Callable[[Camera], Camera], gesture: object = None, stamp: float = 0.0) -> None:
        """Moves the camera; raises `SceneError` where that leads nowhere."""
        with self._lock:
            self._go(replace(self._state, camera=change(self._state.camera)), gesture, stamp)

    def reset_camera(self, stamp: float = 0.0) -> None:
        """The camera as the scene file has it."""
        self.move(lambda _: self._base.camera, None, stamp)

    def switch_focus(self, on: bool, depth: float, stamp: float = 0.0) -> None:
        """Depth of field on, sharp at `depth` from the canvas where the scene does not say, or off."""
        with self._lock:
            settings = self._base.camera.depth_of_field or DepthOfField(focus=depth if depth > 0 else 1.0)
            self._go(self._with_camera(depth_of_field=settings if on else None), None, stamp)

    def show(self, layer: str, stamp: float = 0.0) -> None:
        """Shows another layer."""
        with self._lock:
            self._view = replace(
                self._view,
                layer=layer,
                revision=self._view.revision + 1,
                changed=time.monotonic(),
                stamp=stamp,
            )
        self.on_change()

    def undo(self, stamp: float = 0.0) -> None:
        """Takes the last step back."""
        with self._lock:
            if not self._undo:
                return
            self._gesture = None
            self._rebuild(self._undo.pop(), stamp)
        self.on_change()

    # ---- How ----

    def _with_camera(self, **values: Any) -> State:
        return replace(self._state, camera=moves.changed(self._state.camera, **values))

    def _go(self, state: State, gesture: object, stamp: float, base: Scene | None = None) -> None:
        """Another state; what belongs to one gesture is undone as one."""
        before = self._state
        if state == before:
            return
        self._rebuild(state, stamp, base)
        if gesture is None or gesture != self._gesture:
            self._undo = [*self._undo[-MOST_UNDONE + 1 :], before]
        self._gesture = gesture
        self.on_change()

    def _rebuild(self, state: State, stamp: float = 0.0, base: Scene | None = None) -> None:
        """The scene of a state, made from that of its choices; raises `SceneError` and changes nothing where
        there is none."""
        if base is None:
            base = self._base if state.choices == self._choices else self._source.load(state.choices)
        scene = snapshot(base)
        applied(scene, state.edits)
        scene.camera = state.camera
        structure = base is not self._base or (
            (state.camera.depth_of_field is None) != (self._state.camera.depth_of_field is None)
        )
        self._base, self._choices, self._state = base, state.choices, state
        if structure:
            self._refresh_controls(scene)
        self._view = View(scene, self._view.layer, self._view.revision + 1, time.monotonic(), stamp)

    def _refresh_controls(self, scene: Scene) -> None:
        """Ranges come from the scene as it was loaded, so that they stay where they are under the mouse."""
        unedited = snapshot(self._base)
        unedited.camera = scene.camera
        self.controls = controls_of(unedited)
