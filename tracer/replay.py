"""Kernels are recorded once and replayed, since small pictures take longer to trace in Python than to render.

Dr.Jit runs the Python code of a kernel anew for every launch, to find out which kernel it is. A `Program`
does that once for each structure of its arguments; after that their arrays go straight to the kernels
(`dr.freeze`). What is structure is decided here and not left to Dr.Jit: everything in the arguments that is
no array, the type and the length of every array, and which arrays are one and the same. So a recording never
meets lengths other than its own, which Dr.Jit would have to guess for what the kernels write, and never two
arrays in place of one: of arrays that are the same Dr.Jit remembers the first place only, and would read from
there in every replay (`dr.freeze` of `f([a, b, a])`, replayed with `[a, b, b]`, sees a third `a`).
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, TypeAlias

import drjit as dr

MOST_RECORDINGS = 32
"""Of one program; they hold no arrays."""

MOST_STRUCTURES = 256
"""That are remembered to have been there."""

NOT_IN_KERNELS = {"kernels": False}
"""Metadata of a field of a record that kernels do not read: a program passes it over."""

Structure: TypeAlias = tuple[Any, ...]
"""A node of a tree: (kind, ...). Hashable, and all that is needed to put the arguments together again."""

_LEAF, _PARTS, _RECORD, _CONSTANT = range(4)


class Program:
    """A function of trees of records, lists, tuples, arrays and constants, which gives a dict of arrays.

    The function must not look at what its arrays hold, and all that it depends on must be in its arguments.
    """

    def __init__(self, function: Callable[..., dict[str, Any]]) -> None:
        self._function = function
        self._recordings: OrderedDict[Structure, Callable[..., Any]] = OrderedDict()
        self._lock = threading.Lock()  # two threads must not replay one recording at the same time
        _PROGRAMS.append(self)

    def __call__(self, *arguments: Any) -> dict[str, Any]:
        """The evaluated arrays that the function gives for these arguments."""
        arrays: list[Any] = []
        structure = take_apart(arguments, arrays)
        if not _everything_is_symbolic():
            result = _Performance(self._function, structure)(arrays)
        else:
            with self._lock:
                result = self._recording((dr.thread_count(), structure, _first_places(arrays)))(arrays)
        dr.eval(result)
        return result

    def forget(self) -> None:
        """Drops all recordings."""
        with self._lock:
            self._recordings.clear()

    def _recording(self, key: Structure) -> Callable[[list[Any]], dict[str, Any]]:
        found = self._recordings.get(key)
        if found is None:
            _, structure, _ = key
            found = self._recordings[key] = _recorded(_Performance(self._function, structure))
            if len(self._recordings) > MOST_RECORDINGS:
                self._recordings.popitem(last=False)
        self._recordings.move_to_end(key)
        return found


class FirstTimes:
    """Tells which structures come for the first time."""

    def __init__(self) -> None:
        self._seen: set[Structure] = set()
        _PROGRAMS.append(self)

    def __call__(self, *arguments: Any) -> bool:
        """Whether no arguments of this structure came before; or so many others did that nobody knows."""
        structure = take_apart(arguments, [])
        if structure in self._seen:
            return False
        if len(self._seen) >= MOST_STRUCTURES:
            self._seen.clear()
        self._seen.add(structure)
        return True

    def forget(self) -> None:
        """From now on all come for the first time."""
        self._seen.clear()


_PROGRAMS: list[Program | FirstTimes] = []


def forget_recordings() -> None:
    """Drops the recordings of all programs: for those who change the code of a kernel while it runs."""
    for program in _PROGRAMS:
        program.forget()


class _Performance:
    """The function, with arguments of one structure; a class, in which Dr.Jit does not look for arrays."""

    def __init__(self, function: Callable[..., dict[str, Any]], structure: Structure) -> None:
        self._function, self._structure = function, structure

    def __call__(self, arrays: list[Any]) -> dict[str, Any]:
        return self._function(*put_together(self._structure, iter(arrays)))


def _recorded(performance: _Performance) -> Callable[[list[Any]], dict[str, Any]]:
    """Dr.Jit records again by itself where flags or the alignment of an array differ."""

    @dr.freeze(state_fn=None, auto_opaque=False, limit=4, warn_after=1 << 30)
    def frozen(arrays: list[Any]) -> Any:
        return performance(arrays)

    def replayed(arrays: list[Any]) -> dict[str, Any]:
        failure: BaseException
        try:
            result: dict[str, Any] = frozen(arrays)
            return result
        except RuntimeError as error:
            failure = error
        while failure.__cause__ is not None:  # of the function, or the user's Ctrl-C in it
            failure = failure.__cause__
        raise failure

    return replayed


def _first_places(arrays: list[Any]) -> tuple[int, ...]:
    """For each array the place of the first one that is the same."""
    places: dict[int, int] = {}
    return tuple(places.setdefault(array.index, place) for place, array in enumerate(arrays))


def _everything_is_symbolic() -> bool:
    """Whether no loop and no branch is decided on the host, which nothing could replay."""
    return all(map(dr.flag, (dr.JitFlag.SymbolicLoops, dr.JitFlag.SymbolicConditionals)))


# ---- Trees -------------------------------------------------------------------------------------------------


def take_apart(tree: Any, arrays: list[Any]) -> Structure:
    """The structure of a tree; its arrays, in order, are appended to `arrays`."""
    tree_type: Any = type(tree)
    if tree_type is tuple or tree_type is list:
        return _PARTS, tree_type, *[take_apart(part, arrays) for part in tree]
    names = _fields_of(tree_type)
    if names is not None:
        return _RECORD, tree_type, *[take_apart(getattr(tree, name), arrays) for name in names]
    if not dr.is_array_v(tree_type):
        return _CONSTANT, tree
    if dr.depth_v(tree_type) > 1:
        return _PARTS, tree_type, *[take_apart(part, arrays) for part in tree]
    arrays.append(tree)
    return _LEAF, tree_type, len(tree)


def put_together(structure: Structure, arrays: Iterator[Any]) -> Any:
    """The tree of that structure with these arrays; None for fields that kernels do not read."""
    kind, what, *parts = structure
    if kind == _LEAF:
        return next(arrays)
    if kind == _CONSTANT:
        return what
    trees = [put_together(part, arrays) for part in parts]
    if kind == _RECORD:
        names = _fields_of(what) or ()
        left_out = {field.name: None for field in fields(what) if field.name not in names}
        return what(**dict(zip(names, trees, strict=True)), **left_out)
    return what(*trees) if dr.is_array_v(what) else what(trees)


@cache
def _fields_of(record: Hashable) -> tuple[str, ...] | None:
    """The fields of a record that kernels read; None for any other type."""
    if not is_dataclass(record):
        return None
    return tuple(field.name for field in fields(record) if field.metadata != NOT_IN_KERNELS)
