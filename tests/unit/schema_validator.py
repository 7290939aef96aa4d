"""As much of JSON Schema (draft 2020-12) as the schema of scene files uses; another keyword is an error."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

NOTES = {"$schema", "$defs", "title", "description", "default", "discriminator"}
TYPES: dict[str, type | tuple[type, ...]] = {
    "object": dict,
    "array": list,
    "string": str,
    "number": (int, float),
    "integer": int,
    "boolean": bool,
    "null": type(None),
}
NUMBERS: dict[str, Callable[[Any, Any], bool]] = {
    "minimum": lambda value, limit: value >= limit,
    "maximum": lambda value, limit: value <= limit,
    "exclusiveMinimum": lambda value, limit: value > limit,
    "exclusiveMaximum": lambda value, limit: value < limit,
}
LENGTHS: dict[str, tuple[type, Callable[[int, int], bool]]] = {
    "minLength": (str, int.__ge__),
    "maxLength": (str, int.__le__),
    "minItems": (list, int.__ge__),
    "maxItems": (list, int.__le__),
}


def is_valid(value: Any, schema: Mapping[str, Any], root: Mapping[str, Any]) -> bool:
    """Whether a tree of dicts and lists is valid; `root` holds the definitions."""
    return all(_holds(value, word, schema, root) for word in schema)


def _holds(value: Any, word: str, schema: Mapping[str, Any], root: Mapping[str, Any]) -> bool:
    part = schema[word]
    if word in NOTES or word == "then":
        return True
    if word == "$ref":
        return is_valid(value, root["$defs"][part.rpartition("/")[2]], root)
    if word == "if":
        return not is_valid(value, part, root) or is_valid(value, schema["then"], root)
    if word in ("not", "anyOf", "oneOf"):
        found = sum(is_valid(value, each, root) for each in (part if isinstance(part, list) else [part]))
        return {"not": found == 0, "anyOf": found > 0, "oneOf": found == 1}[word]
    if word == "type":
        return isinstance(value, TYPES[part]) and (part == "boolean" or not isinstance(value, bool))
    if word in ("const", "enum"):
        return value in (part if word == "enum" else [part])
    if word in NUMBERS:
        return not isinstance(value, (int, float)) or NUMBERS[word](value, part)
    if word in LENGTHS:
        kind, fits = LENGTHS[word]
        return not isinstance(value, kind) or fits(len(value), part)
    if word == "pattern":
        return not isinstance(value, str) or re.search(part, value) is not None
    if word in ("items", "prefixItems"):
        return not isinstance(value, list) or _items(value, word, schema, root)
    return not isinstance(value, dict) or _table(value, word, schema, root)


def _items(value: list[Any], word: str, schema: Mapping[str, Any], root: Mapping[str, Any]) -> bool:
    first = schema.get("prefixItems", [])
    if word == "prefixItems":
        return all(is_valid(entry, each, root) for entry, each in zip(value, first, strict=False))
    return all(is_valid(entry, schema["items"], root) for entry in value[len(first) :])


def _table(value: dict[str, Any], word: str, schema: Mapping[str, Any], root: Mapping[str, Any]) -> bool:
    part = schema[word]
    if word == "required":
        return all(key in value for key in part)
    if word == "properties":
        return all(is_valid(value[key], part[key], root) for key in part if key in value)
    if word == "propertyNames":
        return all(is_valid(key, part, root) for key in value)
    if word == "additionalProperties":
        rest = [value[key] for key in value if key not in schema.get("properties", {})]
        return not rest if part is False else all(is_valid(entry, part, root) for entry in rest)
    raise AssertionError(f"the schema uses {word!r}, which this does not know")
