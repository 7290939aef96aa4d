"""What was made of a scene, kept until the scene changes: a viewer asks for the same one again and again."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from tracer.cache import Cache, Stamps
from tracer.scene import Scene
from tracer.scene.contents import Contents, contents_of
from tracer.scene.files import candidates, records_with_files

Made = TypeVar("Made")


@dataclass(frozen=True)
class _Entry(Generic[Made]):
    """What was made; what the scene said but for its camera, where its files may come from, and how they
    were."""

    said: tuple[Contents | None, Path, bool]
    files: Stamps
    made: Made


class LastScenes(Generic[Made]):
    """What was made of the last scene, for each of a few variants."""

    def __init__(self, variants: int, megabytes: int) -> None:
        self._cache: Cache[_Entry[Made]] = Cache(variants, megabytes)

    def get(self, scene: Scene, variant: Hashable, make: Callable[[], tuple[Made, Iterable[Path]]]) -> Made:
        """What was made last, where neither a file nor the scene, but for its camera, has changed since; else
        the scene is checked (`SceneError`) and `make` says what it makes and which files it read."""
        said = contents_of(scene, without=("camera",)), scene.base_dir, scene.allow_outside
        last = self._cache.find(variant)
        if last is not None and said[0] is not None and last.said == said and last.files.still_true:
            return last.made
        since = time.time_ns()
        scene.check()
        made, read = make()
        self._cache.keep(variant, _Entry(said, Stamps.of([*_named(scene), *read], since), made))
        return made


def _named(scene: Scene) -> Iterator[Path]:
    """Where the files of a scene are looked for, also where they are not and another place comes second."""
    for record, _ in records_with_files(scene):
        yield from candidates(record.file, scene.base_dir)
