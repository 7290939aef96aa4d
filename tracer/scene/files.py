"""Which file a name in a scene means, and that it stays in the folders it may come from."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

from tracer.assets import ASSETS
from tracer.messages import Refusal, show
from tracer.shapes.gltf_file import GLTF_SUFFIXES, GltfFile

ASSETS_PREFIX = (
    "assets"  # a name that starts with it means the assets folder where the scene's folder has none
)


def records_with_files(scene: Any) -> Iterator[tuple[Any, tuple[str | int, ...]]]:
    """The textures and shapes of a scene that name a file, each with the path of that key."""
    for key, texture in scene.textures.items():
        if getattr(texture, "file", None) is not None:
            yield texture, ("textures", key, "file")
    for number, shape in enumerate(scene.shapes):
        if getattr(shape, "file", None) is not None:
            yield shape, ("shapes", shape.name or number, "file")


def file_digests(scene: Any) -> dict[str, str]:
    """SHA-256 of what each file of a scene holds, by its name in the scene; each is read once. A glTF file
    holds its buffers, wherever they are."""
    names = dict.fromkeys(record.file for record, _ in records_with_files(scene))
    return {name: _digest(scene.resolve(name)) for name in names}


def _digest(path: Path) -> str:
    beside = GltfFile(path).buffer_files() if path.suffix.lower() in GLTF_SUFFIXES else []
    digest = hashlib.sha256()
    for file in (path, *beside):
        if file.is_file():
            digest.update(file.read_bytes())
    return digest.hexdigest()


def locate(file: str, base_dir: Path, allow_outside: bool, *, also: tuple[Path, ...] = ()) -> Path:
    """The existing regular file that `file` means, as an absolute path.

    `file` is relative to `base_dir` and must lie in it, in the assets folder or in one of `also`, symbolic
    links followed, unless `allow_outside`. Raises `Refusal` otherwise.
    """
    path = place(file, base_dir)
    try:
        inside = any(path.is_relative_to(folder.resolve()) for folder in (base_dir, ASSETS, *also))
        if not (allow_outside or inside):
            raise Refusal(
                f"is {show(file)}, outside the scene's folder; "
                "allowed: a file in that folder or in the assets folder (--allow-outside lifts this)"
            )
        if path.is_dir():
            raise Refusal(f"is {show(file)}, a directory; allowed: a file")
        if not path.exists():
            raise Refusal(f"is {show(file)}, which does not exist; it is looked for in {base_dir}")
        if not path.is_file():
            raise Refusal(f"is {show(file)}, which is not a regular file")
    except OSError as error:
        raise Refusal(f"is {show(file)}, which cannot be read: {error.strerror or error}") from None
    return path


def place(file: str, base_dir: Path) -> Path:
    """The absolute path that `file` means, whether or not anything is there."""
    try:
        for path in candidates(file, base_dir):
            path = path.resolve()
            if path.exists():
                break
        return path
    except (OSError, ValueError, RuntimeError):  # a null character, a name too long, a loop of links
        raise Refusal(f"is {show(file)}, which is no usable file name") from None


def candidates(file: str, base_dir: Path) -> Iterator[Path]:
    """Where a file is looked for: below `base_dir`; then, by its name, below the assets folder."""
    yield base_dir / file
    parts = PurePosixPath(file).parts
    if parts[:1] == (ASSETS_PREFIX,):
        yield ASSETS.joinpath(*parts[1:])


def moved(file: str, base_dir: Path, new_dir: Path) -> str:
    """The name by which a scene in `new_dir` reaches the file that `file` means in `base_dir`."""
    path, new_dir = place(file, base_dir), new_dir.resolve()
    assets = ASSETS.resolve()
    if path.is_relative_to(assets) and not path.is_relative_to(new_dir):
        short = (PurePosixPath(ASSETS_PREFIX) / path.relative_to(assets).as_posix()).as_posix()
        if place(short, new_dir) == path:
            return short
    try:
        return Path(os.path.relpath(path, new_dir)).as_posix()
    except ValueError:  # another drive
        return path.as_posix()
