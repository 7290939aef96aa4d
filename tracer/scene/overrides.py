"""Single values laid over a scene tree: `camera.fov=40`, `shapes.3.radius=2`, `shapes."a b".radius=2`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from tracer.errors import SceneError
from tracer.messages import Refusal, sentence, show, suggestion
from tracer.scene.description import Scene
from tracer.scene.merging import NAMED_LISTS, drop_rivals
from tracer.scene.paths import Part, Path, read_path
from tracer.scene.toml_files import parse_value

_TABLES_OF_NAMES = ("textures", "materials")


def read_overrides(overrides: Sequence[str] | Mapping[str, Any] | str) -> list[tuple[Path, Any]]:
    """Paths and values from `path=value` texts (values as TOML, else strings) or from a mapping."""
    if isinstance(overrides, Mapping):
        return [(_read_path(path)[0], value) for path, value in overrides.items()]
    return [_read_override(text) for text in ([overrides] if isinstance(overrides, str) else overrides)]


def apply_overrides(data: dict[str, Any], overrides: Sequence[tuple[Path, Any]], label: str) -> None:
    """Set the values in the tree `data`; raises `SceneError` for a path that leads nowhere."""
    done: list[Path] = []
    for path, value in overrides:
        node: Any = data
        walked: Path = ()
        for part, following in pairwise(path):
            step = _step(node, part, following, walked, label)
            node, walked = node[step], (*walked, step)
        done.append((*walked, _set(node, path[-1], value, walked, done, label)))


def _read_override(text: str) -> tuple[Path, Any]:
    path, end = _read_path(text)
    if text[end : end + 1] != "=":
        raise SceneError(f"--set {show(text)}: has no `=`; allowed: key=value, such as camera.fov=40")
    return path, parse_value(text[end + 1 :].strip())


def _read_path(text: str) -> tuple[Path, int]:
    try:
        return read_path(text)
    except Refusal as refusal:
        raise SceneError(f"--set {show(text)}: {refusal}") from None


def _step(node: Any, part: Part, following: Part, walked: Path, label: str) -> Any:
    """The key or position that `part` means in `node`; a table that a record may have is made."""
    if isinstance(node, list):
        return _position(node, part, walked, label)
    if not isinstance(node, dict):
        raise SceneError(sentence(label, walked, f"is {show(node)}; there is no `{part}` below it"))
    key = str(part)
    if key not in node:
        if walked and walked[-1] in _TABLES_OF_NAMES:
            what = str(walked[-1]).removesuffix("s")
            raise SceneError(sentence(label, (*walked, key), f"is unknown; {suggestion(key, node, what)}"))
        if not walked and key not in Scene.model_fields:
            raise SceneError(sentence(label, (key,), f"is unknown; {suggestion(key, Scene.model_fields)}"))
        is_list = not walked and key in NAMED_LISTS
        if isinstance(following, int) and not is_list:
            raise SceneError(
                sentence(label, (*walked, key), "is not stated in this scene; set it as a whole")
            )
        node[key] = [] if is_list else {}
    return key


def _position(entries: list[Any], part: Part, walked: Path, label: str) -> int:
    """The position of an entry given by number or by name."""
    names = [entry.get("name") if isinstance(entry, dict) else None for entry in entries]
    if isinstance(part, str) and part in names:
        return names.index(part)
    if isinstance(part, str):
        known = [name for name in names if isinstance(name, str)]
        raise SceneError(sentence(label, (*walked, part), f"is unknown; {suggestion(part, known, 'name')}"))
    if part >= len(entries):
        last = len(entries) - 1
        allowed = f"0 to {last}" if last > 0 else "0" if entries else "none, the list is empty"
        raise SceneError(sentence(label, (*walked, part), f"is out of range; allowed: {allowed}"))
    return part


def _set(node: Any, part: Part, value: Any, walked: Path, done: Sequence[Path], label: str) -> Part:
    if isinstance(node, list):
        number = _position(node, part, walked, label)
        node[number] = value
        return number
    if not isinstance(node, dict):
        raise SceneError(sentence(label, walked, f"is {show(node)}; there is no `{part}` below it"))
    key = str(part)
    set_before = [str(other[-1]) for other in done if other[:-1] == walked]
    drop_rivals(node, (key,), str(walked[0]) if walked else "", keep=set_before)
    node[key] = value
    return key
