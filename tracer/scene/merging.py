"""How one scene tree is laid over another: `base`, `remove`, and keys that exclude each other.

Tables merge key by key; an entry of `lights` or `shapes` whose `name` (of `animation`: whose `key`) the base
knows changes that entry, others are appended; every other list is replaced. A key drops the base's keys that
it excludes (a `color` the base's `texture`, a look-at key the base's canvas); an entry of another `kind`
replaces the base's entry.
"""

from __future__ import annotations

import copy
from collections.abc import Collection, Mapping
from typing import Any

from tracer.camera import CANVAS_KEYS, LOOK_AT_KEYS
from tracer.errors import SceneError
from tracer.messages import sentence, show, suggestion
from tracer.records import Record

NAMED_LISTS = ("lights", "shapes")
_IDENTITIES = {"lights": "name", "shapes": "name", "animation": "key"}
"""What tells that two entries of a list are the same one."""

_RIVALS: dict[str, tuple[frozenset[str], ...]] = {
    "camera": (frozenset(CANVAS_KEYS), frozenset(LOOK_AT_KEYS)),
    "texture or color": (frozenset({"texture"}), frozenset({"color"})),
    "source": (frozenset({"file"}), frozenset({"vertices", "faces"}), frozenset({"builtin"})),
    "plane": (frozenset({"coefficients"}), frozenset({"point", "u", "v"})),
}
_SHAPE_RIVALS = ("texture or color", "source", "plane")


def plain_tree(value: Any) -> Any:
    """A copy in plain dicts and lists, to be changed freely; records become dicts."""
    if isinstance(value, Record):
        return value.to_dict()
    if isinstance(value, Mapping):
        return {key: plain_tree(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain_tree(entry) for entry in value]
    return copy.copy(value)


def merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """The tree `over` laid over the tree `base`; `base` is changed and returned."""
    for key, value in over.items():
        if key in _IDENTITIES and _are_tables(value) and _are_tables(base.get(key)):
            base[key] = _merged_entries(base[key], value, key)
        elif isinstance(value, dict) and isinstance(base.get(key), dict):
            base[key] = _merged_table(base[key], value, key)
        else:
            base[key] = value
    return base


def removed(base: dict[str, Any], names: Any, label: str) -> dict[str, Any]:
    """`base` without the lights and shapes of these names; raises `SceneError` for a name that it lacks."""
    if not (isinstance(names, list) and all(isinstance(name, str) for name in names)):
        raise SceneError(sentence(label, ("remove",), f"is {show(names)}; allowed: a list of names"))
    lists = {key: base[key] for key in NAMED_LISTS if _are_tables(base.get(key))}
    known = [
        entry["name"] for entries in lists.values() for entry in entries if isinstance(entry.get("name"), str)
    ]
    for name in names:
        if name not in known:
            what = (
                f"has {show(name)}, which is no light or shape of the base; {suggestion(name, known, 'name')}"
            )
            raise SceneError(sentence(label, ("remove",), what))
    for key, entries in lists.items():
        base[key] = [entry for entry in entries if entry.get("name") not in names]
    return base


def drop_rivals(table: dict[str, Any], keys: Collection[str], place: str, keep: Collection[str] = ()) -> None:
    """Remove from a camera or shape table what the new `keys` exclude, except the keys in `keep`."""
    groups = ("camera",) if place == "camera" else _SHAPE_RIVALS if place == "shapes" else ()
    for group in groups:
        sides = _RIVALS[group]
        for side in sides:
            if not side.intersection(keys):
                continue
            rivals = frozenset().union(*sides) - side
            if group == "camera" and _changes_form(table, side):
                rivals |= {"distance"}
            for rival in rivals.difference(keys, keep):
                table.pop(rival, None)


def _changes_form(camera: dict[str, Any], side: frozenset[str]) -> bool:
    """Whether keys of `side` turn one form of camera into the other, where a distance means another thing."""
    return (side == frozenset(LOOK_AT_KEYS)) != any(key in camera for key in LOOK_AT_KEYS)


def _merged_entries(
    base: list[dict[str, Any]], over: list[dict[str, Any]], place: str
) -> list[dict[str, Any]]:
    identity = _IDENTITIES[place]
    open_places = {entry[identity]: i for i, entry in enumerate(base) if isinstance(entry.get(identity), str)}
    for entry in over:
        name = entry.get(identity)
        number = open_places.pop(name, None) if isinstance(name, str) else None
        if number is None:
            base.append(entry)
        else:
            base[number] = _merged_table(base[number], entry, place)
    return base


def _merged_table(base: dict[str, Any], over: dict[str, Any], place: str) -> dict[str, Any]:
    if "kind" in over and over["kind"] != base.get("kind"):
        return over
    drop_rivals(base, over.keys(), place)
    for key, value in over.items():
        if isinstance(value, dict) and isinstance(base.get(key), dict):
            base[key] = _merged_table(base[key], value, key)
        else:
            base[key] = value
    return base


def _are_tables(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(entry, dict) for entry in value)
