"""Makes the pictures of a view, and gives one up that nobody waits for any more."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable

from tracer.film.result import Result
from tracer.render import render
from tracer.scene import Scene
from tracer.viewer.drafts import compile_copies, compile_filters, draft_of
from tracer.viewer.frames import DRAFT_QUALITY, STILL_QUALITY, Frame, compressed
from tracer.viewer.layers import aovs_of, picture_of
from tracer.viewer.stages import Stage
from tracer.viewer.state import View

RAYS_PER_BAND = 1 << 17
"""Primary rays of a launch while a picture is sharpened: soon given up when something moves."""


class Dropped(Exception):
    """Nobody waits for this picture any more."""


class Pictures:
    """Pictures of a scene that was `loaded` so, and is edited."""

    def __init__(self, loaded: Scene, backend: str) -> None:
        self._loaded, self._backend = loaded, backend
        self._numbers = itertools.count(1)
        self._has_filters = False

    def prepare(self) -> None:
        """Compiles what no picture shows to be needed."""
        compile_copies(self._backend)

    def frame(self, view: View, stage: Stage, is_wanted: Callable[[], bool]) -> Frame:
        """A stage of a view; raises `Dropped` where it is no draft and no longer wanted."""
        self._prepare_focus(view.scene)
        started = time.perf_counter()
        result = self._rendered(view, stage, is_wanted)
        rendered = time.perf_counter()
        image = picture_of(view.layer, result, legend=not stage.is_draft)
        jpeg = compressed(image, DRAFT_QUALITY if stage.is_draft else STILL_QUALITY)
        done = time.perf_counter()
        height, width = image.shape[:2]
        return Frame(
            number=next(self._numbers),
            revision=view.revision,
            stamp=view.stamp,
            layer=view.layer,
            width=width,
            height=height,
            scale=stage.scale,
            supersample=stage.supersample,
            final=stage.is_final,
            depth=float(result.depth[height // 2, width // 2]),
            seconds={"render": rendered - started, "compress": done - rendered},
            jpeg=jpeg,
        )

    def _prepare_focus(self, scene: Scene) -> None:
        """Compiles what moving the focus will need, when depth of field is on for the first time."""
        if scene.camera.depth_of_field is not None and not self._has_filters:
            self._has_filters = True
            compile_filters(scene, self._backend)

    def _rendered(self, view: View, stage: Stage, is_wanted: Callable[[], bool]) -> Result:
        def progress(*_: int) -> None:
            if not (stage.is_draft or is_wanted()):
                raise Dropped

        return render(
            draft_of(view.scene, self._loaded) if stage.is_draft else view.scene,
            backend=self._backend,
            supersample=stage.supersample,
            aovs=("depth", *aovs_of(view.layer)),
            scale=stage.scale,
            rays_per_band=RAYS_PER_BAND if stage.supersample > 1 else 1 << 21,
            progress=progress,
        )
