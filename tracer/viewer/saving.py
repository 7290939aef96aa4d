"""Scenes and stills into the scene's folder: under a name of ours, never over a file that is there."""

from __future__ import annotations

import itertools
import os
import re
from pathlib import Path

from tracer.errors import OutputError
from tracer.film.atomic import check_writable
from tracer.render import render
from tracer.scene import Scene, load
from tracer.scene.toml_files import read_toml

SUFFIXES = (".toml", ".png", ".exr")
MOST_FILES = 9999


class Folder:
    """Where a viewer writes. A scene and the stills of it share a name, NAME-view-K, as long as the scene
    stays as it is."""

    def __init__(self, folder: Path, name: str) -> None:
        self._folder = folder.resolve()
        self._name = re.sub(r"[^\w.-]", "_", name)[:100].lstrip(".") or "scene"
        self._last: tuple[Scene, str] | None = None

    def save_scene(self, scene: Scene) -> Path:
        """Writes the scene as TOML; raises `OutputError`."""
        target = self._target(scene, ".toml")
        if not target.exists():
            scene.save(target)
        return target

    def save_still(self, scene: Scene, suffix: str, backend: str) -> Path:
        """Writes the picture that `tracer render` gives for the saved scene, which is saved beside it."""
        target = self._target(scene, suffix)
        check_writable(target)
        if not target.exists():
            render(self._as_saved(scene), backend=backend).save(target)
        return target

    def _as_saved(self, scene: Scene) -> Scene:
        """The scene as it is loaded from its file: the names of files, and with them the header of an OpenEXR
        file, depend on where that lies."""
        target = self.save_scene(scene)
        tree = read_toml(target, target.name)
        allow = scene.allow_outside
        saved = load(tree, base_dir=self._folder, allow_outside=allow)
        return saved.come_from(name=target.stem, base_dir=self._folder, allow_outside=allow)

    def _target(self, scene: Scene, suffix: str) -> Path:
        if self._last is None or self._last[0] is not scene:
            self._last = scene, self._free_stem()
        return self._folder / f"{self._last[1]}{suffix}"

    def _free_stem(self) -> str:
        for number in itertools.count(1):
            stem = f"{self._name}-view-{number}"
            if not any(os.path.lexists(self._folder / f"{stem}{suffix}") for suffix in SUFFIXES):
                return stem
            if number == MOST_FILES:
                break
        raise OutputError(f"{self._folder}: holds {MOST_FILES} scenes of this viewer already; remove some")
