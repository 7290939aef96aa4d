"""The records of a session: where the scene comes from, what can be undone, what is to be shown."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from tracer.camera import Camera
from tracer.scene import Scene
from tracer.viewer.edits import Edits


@dataclass(frozen=True)
class Source:
    """Where the scene comes from: `load` gives it for the `choices` (none, or the document's six, with their
    labels and the words for no and yes)."""

    load: Callable[[dict[str, bool]], Scene]
    choices: Mapping[str, bool] = field(default_factory=dict)
    labels: Mapping[str, tuple[str, str, str]] = field(default_factory=dict)


@dataclass(frozen=True)
class State:
    """All that can be undone."""

    choices: dict[str, bool]
    edits: Edits
    camera: Camera


@dataclass(frozen=True)
class View:
    """What is to be shown: the scene, a layer of it; `revision` counts the changes, `changed` is when the
    last one came (`time.monotonic`), `stamp` what the page sent with it."""

    scene: Scene
    layer: str
    revision: int
    changed: float
    stamp: float
