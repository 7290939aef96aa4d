"""What a scene says, in a form that can be compared and kept while the scene itself may change."""

from __future__ import annotations

import copy
import marshal
from collections.abc import Container, Hashable
from dataclasses import dataclass
from functools import cache
from typing import Any

from tracer.records import Record
from tracer.scene.description import Scene

LARGE = 64
"""Entries of a tuple from which it is told by its identity: nothing in a tuple of a record can change."""


@dataclass(frozen=True)
class Contents:
    """Equal where records say the same, to the sign of a zero. `large`: the tuples that `text` only names,
    kept alive so that no other one takes their place."""

    text: bytes
    large: tuple[Any, ...]


def contents_of(record: Record, without: Container[str] = ()) -> Contents | None:
    """What a record and those below it say, but for some keys at the top; None where a value that nothing has
    checked yet is none of a record's."""
    large: list[Any] = []
    top = _contents({key: value for key, value in vars(record).items() if key not in without}, large)
    try:
        return Contents(marshal.dumps(top, 2), tuple(large))
    except ValueError:
        return None


def _contents(value: Any, large: list[Any]) -> Any:
    """The value as lists, tuples, numbers and strings."""
    kind: Any = type(value)
    if kind is tuple and len(value) >= LARGE:
        large.append(value)
        return ["large", id(value)]
    if kind is list:
        return [_contents(entry, large) for entry in value]
    if kind is dict:
        return [(key, _contents(entry, large)) for key, entry in value.items()]
    return [kind.__name__, _contents(vars(value), large)] if _is_record(kind) else value


def snapshot(scene: Scene) -> Scene:
    """The scene as it is now; what stays unchanged when records change is shared."""
    result: Scene = _copied(scene)
    return result


def _copied(value: Any) -> Any:
    kind: Any = type(value)
    if kind is list:
        return [_copied(entry) for entry in value]
    if kind is dict:
        return {key: _copied(entry) for key, entry in value.items()}
    if not _is_record(kind):
        return value
    twin = copy.copy(value)
    twin.__dict__.update({key: _copied(entry) for key, entry in vars(value).items()})
    return twin


@cache
def _is_record(kind: Hashable) -> bool:
    return isinstance(kind, type) and issubclass(kind, Record)
