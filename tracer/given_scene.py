"""The scene that a public function was given."""

from __future__ import annotations

from tracer.errors import UsageError
from tracer.messages import show
from tracer.scene import Scene


def given_scene(scene: object) -> Scene:
    """The scene itself; raises `UsageError` for a path or a dict, which `tracer.load` makes a scene of."""
    if not isinstance(scene, Scene):
        raise UsageError(f"scene: {show(scene)} is no Scene; allowed: what tracer.load returns")
    return scene
