"""A scene at one frame: the values of its `[[animation]]` tables put in the place of their keys.

Only records on the way to a key are copied; every value is checked like any other assignment.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tracer.errors import SceneError
from tracer.messages import Refusal, show, suggestion
from tracer.records import Record
from tracer.scene.animation import Track
from tracer.scene.paths import Part, Path, read_path

_WHOLE_NUMBERS = ("seed",)
"""Whole numbers that are read from memory; the others say how many there are of something."""


def check_tracks(scene: Any) -> None:
    """Raise `Refusal` for a key that is not there, cannot change or cannot have one of its values."""
    seen: dict[Path, int] = {}
    still = _without_animation(scene)
    for number, track in enumerate(scene.animation):
        place = ("animation", number)
        try:
            path = _path_of(still, track)
            if path in seen:
                raise Refusal(f"is {show(track.key)}, which `animation.{seen[path]}` keys already")
            _check_movable(_value_at(still, path), path, track.key)
        except Refusal as refusal:
            raise Refusal(str(refusal), *place, "key") from None
        seen[path] = number
        for entry, value in enumerate(track.values):
            try:
                _with_value(still, path, value)
            except (SceneError, Refusal) as error:
                raise Refusal(
                    f"cannot be the value of `{track.key}`: {error}", *place, "values", entry
                ) from None


def scene_at(scene: Any, frame: float) -> Any:
    """The scene at a frame, without animation; raises `Refusal` for values that do not fit together."""
    still = _without_animation(scene)
    for track in scene.animation:
        try:
            still = _with_value(still, _path_of(still, track), track.at(frame))
        except SceneError as error:
            raise Refusal(
                f"cannot be {show(track.at(frame))} at frame {frame:g}: {error}", track.key
            ) from None
    return still


def _without_animation(scene: Any) -> Any:
    still = scene.model_copy(update={"animation": []})
    still.model_fields_set.discard("animation")
    return still


def _path_of(scene: Any, track: Track) -> Path:
    """The path of a track with names in lists replaced by positions."""
    path, end = read_path(track.key)
    if track.key[end:]:
        raise Refusal(f"is {show(track.key)}, which is no path; allowed: keys joined by dots")
    node, walked = scene, []
    for part in path:
        step = _step(node, part, track.key)
        walked.append(step)
        node = child_of(node, step)
    return tuple(walked)


def _step(node: Any, part: Part, key: str) -> Part:
    """The attribute, name or position that a part of a path means; raises `Refusal`."""
    if isinstance(node, (list, tuple)):
        if isinstance(part, int) and part < len(node):
            return part
        names = [getattr(entry, "name", None) for entry in node]
        if part in names:
            return names.index(part)
        known = [name for name in names if isinstance(name, str)]
        positions = f"allowed: 0 to {len(node) - 1}" if node else "the list is empty"
        hint = suggestion(str(part), known, "name") if known else positions
        raise Refusal(f"is {show(key)}, but there is no entry `{part}`; {hint}")
    known_keys: Sequence[str] = ()
    if isinstance(node, Mapping):
        known_keys = list(node)
    elif isinstance(node, Record):
        known_keys = list(type(node).model_fields)
    if str(part) not in known_keys:
        hint = suggestion(str(part), known_keys) if known_keys else "there is nothing below a number"
        raise Refusal(f"is {show(key)}, but `{part}` is unknown; {hint}")
    return str(part)


def child_of(node: Any, step: Part) -> Any:
    """What lies a step of a path below a record, a table or a list."""
    return getattr(node, str(step)) if isinstance(node, Record) else node[step]


def _value_at(node: Any, path: Path) -> Any:
    for step in path:
        node = child_of(node, step)
    return node


def _check_movable(value: Any, path: Path, key: str) -> None:
    """Refuses what is no number, and numbers that are compiled into kernels."""
    if value is None:
        raise Refusal(f"is {show(key)}, which the scene does not state; state it, then key it")
    if path == ("cutoff",) or (_is_whole(value) and path[-1] not in _WHOLE_NUMBERS):
        raise Refusal(
            f"is {show(key)}, which is part of the compiled program and not a number in memory; "
            "it is the same in all frames"
        )
    if not _is_real(value) and not _is_whole(value):
        raise Refusal(f"is {show(key)}, which is no number, vector or color")


def _is_whole(value: Any) -> bool:
    """A whole number, or a list of them such as a resolution."""
    if isinstance(value, (list, tuple)):
        return bool(value) and all(map(_is_whole, value))
    return isinstance(value, int) and not isinstance(value, bool)


def _is_real(value: Any) -> bool:
    if isinstance(value, (list, tuple)):
        return bool(value) and all(map(_is_real, value))
    return isinstance(value, float)


def _with_value(node: Any, path: Path, value: Any) -> Any:
    """A copy of `node` with the value at the end of the path; raises `SceneError` where it does not fit."""
    if not path:
        return round(value) if _is_whole(node) and isinstance(value, float) else value
    child = _with_value(child_of(node, path[0]), path[1:], value)
    if isinstance(node, Record):
        twin = node.model_copy()
        setattr(twin, str(path[0]), child)
        return twin
    if isinstance(node, Mapping):
        return {**node, str(path[0]): child}
    number = int(path[0])
    return type(node)([*node[:number], child, *node[number + 1 :]])
