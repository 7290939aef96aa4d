"""Reading TOML text, with every fault of the text as one sentence."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from tracer.errors import SceneError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

TOO_DEEP = "is nested too deeply; a scene needs six levels of tables and lists"
LARGEST_FILE = 64 * 2**20  # bytes; meshes of that size belong in a file of their own

_PLACE = re.compile(r"^(.*?)\s*\(at (?:line (\d+), column (\d+)|end of document)\)$", re.DOTALL)


def read_toml(path: Path, label: str) -> dict[str, Any]:
    """The tree of a TOML file; raises `SceneError` with line and column."""
    return parse_toml(_read_text(path, label), label)


def parse_toml(text: str, label: str) -> dict[str, Any]:
    """The tree of a TOML text; raises `SceneError` with line and column."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SceneError(_syntax_sentence(str(error), text, label)) from None
    except RecursionError:
        raise SceneError(f"{label}: {TOO_DEEP}") from None
    except ValueError as error:  # a date or a number that Python cannot hold
        raise SceneError(f"{label}: not valid TOML: {error}") from None


def parse_value(text: str) -> Any:
    """One TOML value, else the text itself."""
    try:
        tree = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return tree["value"] if len(tree) == 1 else text


def _read_text(path: Path, label: str) -> str:
    try:
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise SceneError(f"{label}: has {size} bytes; allowed: at most {LARGEST_FILE} (use mesh files)")
        content = path.read_bytes()
    except OSError as error:
        raise SceneError(f"{label}: cannot be read: {error.strerror or error}") from None
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        column = error.start - (content.rfind(b"\n", 0, error.start) + 1) + 1
        raise SceneError(
            f"{label}, line {line}, column {column}: the byte 0x{content[error.start]:02x} is no UTF-8 text; "
            "allowed: a TOML file in UTF-8"
        ) from None


def _syntax_sentence(message: str, text: str, label: str) -> str:
    match = _PLACE.match(message)
    if match is None:
        return f"{label}: not valid TOML: {message}"
    what, line, column = match.groups()
    if line is None:
        line, column = str(text.count("\n") + 1), str(len(text) - text.rfind("\n"))
    return f"{label}, line {line}, column {column}: not valid TOML: {what[:200]}"
