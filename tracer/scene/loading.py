"""Loading: from a file, a built-in name or a dict to a validated `Scene`; every fault is one `SceneError`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from tracer.assets import SCENES, builtin_scenes
from tracer.errors import SceneError
from tracer.messages import Refusal, nearest, sentence, show
from tracer.scene.description import Scene
from tracer.scene.files import locate, moved
from tracer.scene.merging import merged, plain_tree, removed
from tracer.scene.overrides import apply_overrides, read_overrides
from tracer.scene.toml_files import TOO_DEEP, read_toml
from tracer.validation import validation_sentence


def load(
    source: str | Path | Mapping[str, Any],
    base_dir: str | Path | None = None,
    allow_outside: bool = False,
    overrides: Sequence[str] | Mapping[str, Any] = (),
) -> Scene:
    """The scene of a TOML file, of a built-in name such as "classic", or of a dict of the same shape.

    File names in it are relative to `base_dir`: by default the scene file's folder, for a dict the working
    directory. They may not leave that folder or the assets folder unless `allow_outside`. `overrides` are
    `path=value` texts or a mapping from path to value. Raises `SceneError`.
    """
    if isinstance(source, Mapping):
        name = label = "scene"
        folder = Path.cwd()
    else:
        path, label = find_scene(source)
        name, folder = path.stem, path.parent
    folder = folder if base_dir is None else Path(base_dir)
    try:
        if isinstance(source, Mapping):
            data, chain = plain_tree(source), []
        else:
            data, chain = read_toml(path, label), [path.resolve()]
        data = _with_base(data, folder, folder, allow_outside, label, chain)
        apply_overrides(data, read_overrides(overrides), label)
        scene = Scene.model_validate(data)
    except ValidationError as error:
        raise SceneError(validation_sentence(error, Scene, data, label)) from None
    except RecursionError:
        raise SceneError(f"{label}: {TOO_DEEP}") from None
    scene.come_from(name=name, label=label, base_dir=folder, allow_outside=allow_outside)
    scene.check_files()
    return scene


def find_scene(source: str | Path) -> tuple[Path, str]:
    """The scene file that a path or a built-in name means, and what messages call it."""
    if not isinstance(source, (str, Path)):
        raise SceneError(f"scene: {show(source)} is no scene; allowed: a path, a built-in name or a dict")
    if not str(source) or "\0" in str(source):
        raise SceneError(f"scene: {show(str(source))} is no usable file name")
    path, builtin = Path(source), builtin_scenes()
    try:
        if path.is_file():
            return path, str(source)
        if str(source) in builtin:
            return builtin[str(source)], str(source)
        is_directory, exists = path.is_dir(), path.exists()
    except OSError:  # a name too long
        raise SceneError(f"scene: {show(str(source))} is no usable file name") from None
    if is_directory:
        raise SceneError(f"{source}: is a directory; allowed: a scene file")
    if exists:
        raise SceneError(f"{source}: is not a regular file; allowed: a scene file")
    best = nearest(path.stem, builtin)
    hint = f"; the nearest built-in scene is `{best}`" if best else ""
    raise SceneError(f"{source}: there is no such scene file and no such built-in scene{hint}")


def _with_base(
    data: dict[str, Any], folder: Path, root: Path, allow_outside: bool, label: str, chain: list[Path]
) -> dict[str, Any]:
    """`data`, whose file lies in `folder`, laid over its base; `root` is the loaded scene's folder."""
    base_name, names = data.pop("base", None), data.pop("remove", None)
    base: dict[str, Any] = {}
    if base_name is not None:
        path = _base_path(base_name, folder, root, allow_outside, label)
        if path in chain:
            circle = " → ".join(link.name for link in [*chain[chain.index(path) :], path])
            raise SceneError(
                sentence(label, ("base",), f"leads back to a scene that it comes from: {circle}")
            )
        base_label = base_name if path.parent == SCENES.resolve() else str(path)
        base = read_toml(path, base_label)
        base = _with_base(base, path.parent, root, allow_outside, base_label, [*chain, path])
        _move_files(base, path.parent, folder)
    if names is not None:
        base = removed(base, names, label)
    return merged(base, data)


def _base_path(name: Any, folder: Path, root: Path, allow_outside: bool, label: str) -> Path:
    if not isinstance(name, str):
        raise SceneError(
            sentence(label, ("base",), f"is {show(name)}; allowed: a scene file or a built-in name")
        )
    builtin = builtin_scenes()
    try:
        if name in builtin and not (folder / name).is_file():
            return builtin[name].resolve()
        return locate(name, folder, allow_outside, also=(root, SCENES))
    except Refusal as refusal:
        raise SceneError(sentence(label, ("base",), str(refusal))) from None


def _move_files(data: dict[str, Any], old: Path, new: Path) -> None:
    """Rewrite the file names of a base so that they mean the same from the folder `new`."""
    if old.resolve() == new.resolve():
        return
    textures, shapes = data.get("textures"), data.get("shapes")
    entries = [
        *(textures.values() if isinstance(textures, dict) else ()),
        *(shapes if isinstance(shapes, list) else ()),
    ]
    for entry in entries:
        if isinstance(entry, dict) and isinstance(entry.get("file"), str):
            try:
                entry["file"] = moved(entry["file"], old, new)
            except Refusal:
                continue  # the name is unusable; the check of the whole scene says so with its key
