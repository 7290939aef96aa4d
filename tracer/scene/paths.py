"""Dotted paths to a value of a scene: `camera.fov`, `shapes.3.radius`, `shapes."a b".radius`."""

from __future__ import annotations

import json
import re

from tracer.messages import Refusal

Part = str | int
Path = tuple[Part, ...]

_PART = re.compile(r"""\s*(?:("(?:[^"\\]|\\.)*")|'([^']*)'|([^\s."'=]+))\s*""")


def read_path(text: str) -> tuple[Path, int]:
    """The parts of the path at the start of `text`, and where it ends; bare digits are a position, quoted
    ones a name. Raises `Refusal`."""
    parts: list[Part] = []
    place = 0
    while match := _PART.match(text, place):
        double, single, bare = match.groups()
        place = match.end()
        if bare is not None:
            parts.append(int(bare) if bare.isdecimal() and len(bare) < 10 else bare)
        else:
            parts.append(_unquoted(double) if double is not None else single)
        if text[place : place + 1] != ".":
            return tuple(parts), place
        place += 1
    raise Refusal("is no path; allowed: keys joined by dots, odd names in quotes")


def _unquoted(quoted: str) -> str:
    try:
        return str(json.loads(quoted))
    except ValueError:
        raise Refusal(f"holds {quoted}, which is no quoted name") from None
