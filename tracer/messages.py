"""The words of messages: how values, paths and suggestions read, and the objection that a check raises.

A sentence reads: where (file), which key (dotted path), what was found, what is allowed.
"""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

LONGEST_SHOWN = 60  # characters of a value that a message repeats


class Refusal(ValueError):
    """A check's objection: the rest of the sentence after the key, and the key's path below the record."""

    def __init__(self, text: str, *path: str | int) -> None:
        super().__init__(text)
        self.path = path


def show(value: Any) -> str:
    """A value as the user wrote it, shortened; containers only when they are short and flat."""
    if value is None:
        return "nothing"
    if isinstance(value, str):
        text = json.dumps(value[: LONGEST_SHOWN + 1], ensure_ascii=False)
        return text if len(value) <= LONGEST_SHOWN else f'{text[:LONGEST_SHOWN]}…"'
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int) and abs(value) >= 10**LONGEST_SHOWN:
        return "a number of more than 60 digits"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, (list, tuple)):
        if len(value) <= 4 and all(isinstance(v, (bool, int, float, str)) for v in value):
            return f"[{', '.join(show(v) for v in value)}]"
        return f"a list of {len(value)}"
    return f"a {type(value).__name__}"


def nearest(word: str, known: Iterable[str]) -> str | None:
    """The known word closest to `word`, or None when none resembles it."""
    known = list(known)
    lower = {name.lower(): name for name in known}
    matches = difflib.get_close_matches(word.lower()[:LONGEST_SHOWN], lower, n=1, cutoff=0.4)
    return lower[matches[0]] if matches else None


def suggestion(word: str, known: Iterable[str], what: str = "key") -> str:
    """The words "the nearest known key is `x`", or the list of the known ones when none is near."""
    known = list(known)
    best = nearest(word, known)
    if best is not None:
        return f"the nearest known {what} is `{best}`"
    shown = ", ".join(f"`{name}`" for name in known[:30])
    return f"known: {shown}" if shown else f"there is no {what}"


def dotted(path: Sequence[str | int]) -> str:
    """A path as the user writes it: bare keys, numbers and quoted names, joined by dots."""
    return ".".join(
        str(part) if isinstance(part, int) or re.fullmatch(r"[A-Za-z_][\w-]*", part, re.ASCII) else show(part)
        for part in path
    )


def sentence(label: str, path: Sequence[str | int], text: str) -> str:
    """`label: key text`, or `label text` for the whole."""
    return f"{label}: `{dotted(path)}` {text}" if path else f"{label} {text}"
