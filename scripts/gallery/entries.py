"""The scenes of the gallery: how they are grouped, what is said of them, when a rendered one is stale."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import tracer
from tracer.assets import builtin_scenes
from tracer.cli.scenes import first_comment
from tracer.render import scene_hash
from tracer.scene.files import records_with_files

DOCUMENT = ("classic", "classic_rotated", "classic_focus", "classic_rabbit")
"""The document's own pictures, in its order; other scenes of that room follow by name."""

GROUPS = {
    "classic": "The document's pictures",
    "room": "Benchmark room",
    "shape": "Shapes",
    "texture": "Textures",
    "light": "Lights",
    "optics": "Optics",
    "option": "Options",
}
"""The first word of a scene's name, and the title of its group, in the order of the page."""
OTHERS = "More scenes"


@dataclass(frozen=True)
class Entry:
    """One scene: its file, and what the pages say about it."""

    name: str
    path: Path
    caption: str  # the first line of the scene's opening comment, a sentence
    text: str  # the whole file, comments included
    fingerprint: str  # changes when the picture may have changed

    @property
    def group(self) -> str:
        """The title of the group that the scene belongs to."""
        return GROUPS.get(self.name.partition("_")[0], OTHERS)


def entries() -> list[Entry]:
    """All built-in scenes in the order of the page. Raises SceneError."""
    found = [read_entry(path) for path in builtin_scenes().values()]
    titles = [*GROUPS.values(), OTHERS]
    document = {name: number for number, name in enumerate(DOCUMENT)}
    return sorted(
        found,
        key=lambda entry: (titles.index(entry.group), document.get(entry.name, len(document)), entry.name),
    )


def read_entry(path: Path) -> Entry:
    """The entry of one scene file. Raises SceneError."""
    return Entry(
        name=path.stem,
        path=path,
        caption=first_comment(path),
        text=path.read_text(encoding="utf-8"),
        fingerprint=fingerprint(tracer.load(path)),
    )


def fingerprint(scene: tracer.Scene) -> str:
    """SHA-256 of the scene's keys, as `scene_hash` gives it, and of the pictures and meshes that it names.

    The scene hash alone would miss a picture that was redrawn under its old name.
    """
    digest = hashlib.sha256(scene_hash(scene).encode())
    for record, _ in records_with_files(scene):
        digest.update(hashlib.sha256(scene.resolve(record.file).read_bytes()).digest())
    return digest.hexdigest()
