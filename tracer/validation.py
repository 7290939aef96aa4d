"""One sentence out of whatever pydantic objects to (as messages say it: key, found, allowed)."""

from __future__ import annotations

import re
import typing
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ValidationError

from tracer.messages import Refusal, nearest, sentence, show, suggestion

_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument", "no_such_attribute")
_LIMITS = {
    "greater_than": ("greater than", "gt"),
    "greater_than_equal": ("at least", "ge"),
    "less_than": ("less than", "lt"),
    "less_than_equal": ("at most", "le"),
}
_TYPES = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "string_type": "a string",
    "tuple_type": "a list",
    "list_type": "a list",
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "finite_number": "a finite number",
}


def validation_sentence(
    error: ValidationError, record: type[BaseModel], data: Mapping[str, Any], label: str
) -> str:
    """The first objection in `error` as one sentence, and how many more there are.

    `record` is the type that was validated and `data` its input: they give known keys and names of entries.
    """
    errors: list[Any] = error.errors(include_url=False)
    errors.sort(key=lambda one: one["type"] not in _UNKNOWN)  # a misspelt key is why another one is missing
    first, rest = errors[0], errors[1:]
    if first["type"] == "missing" and isinstance(first["loc"][-1], int):
        path, _ = _locate(first["loc"][:-1], record)
        absent = [one for one in errors if one["loc"][:-1] == first["loc"][:-1]]
        text = f"has {_entries(len(first['input']))}; allowed: {absent[-1]['loc'][-1] + 1}"
        rest = [one for one in errors if one not in absent]
    else:
        path, text = _objection(first, record)
    tail = f" (and {len(rest)} more error{'s' if len(rest) > 1 else ''})" if rest else ""
    return sentence(label, _with_names(path, data), text + tail)


def _entries(count: int) -> str:
    return f"{count} {'entry' if count == 1 else 'entries'}"


def _objection(error: dict[str, Any], record: type[BaseModel]) -> tuple[list[str | int], str]:
    """Path and rest of the sentence for one pydantic error."""
    kind, found, context = error["type"], show(error["input"]), error.get("ctx", {})
    path, records = _locate(error["loc"], record)
    if path[-1:] == ["[key]"] and kind.startswith("string_too_"):  # pydantic's mark of the key itself
        path = path[:-1]
    if kind == "missing":
        return path, "is missing; it must be given"
    if kind in _UNKNOWN:
        known = [key for candidate in records for key in candidate.model_fields]
        return path, f"is unknown; {suggestion(str(path[-1]), known)}"
    if kind in _LIMITS:
        words, key = _LIMITS[kind]
        return path, f"is {found}; allowed: {words} {context[key]:g}"
    if kind in _TYPES:
        return path, f"is {found}; allowed: {_TYPES[kind]}"
    if kind == "literal_error":
        return path, f"is {found}; allowed: {context['expected'].replace(chr(39), chr(34))}"
    if kind == "union_tag_invalid":
        return [*path, "kind"], _wrong_kind(context)
    if kind == "union_tag_not_found":
        kinds = [candidate.model_fields["kind"].default for candidate in records]
        return [*path, "kind"], f"is missing; allowed: {', '.join(map(show, kinds))}"
    if kind in ("too_short", "too_long"):
        limit = context["min_length" if kind == "too_short" else "max_length"]
        words = "at least" if kind == "too_short" else "at most"
        return path, f"has {_entries(len(error['input']))}; allowed: {words} {limit}"
    if kind == "string_too_short":
        return path, f"is {found}; allowed: a string that is not empty"
    if kind == "string_too_long":
        return path, f"has {len(error['input'])} characters; allowed: at most {context['max_length']}"
    if kind == "value_error" and isinstance(context.get("error"), Refusal):
        refusal = context["error"]
        return [*path, *refusal.path], str(refusal)
    return path, f"is {found}; {error['msg'][0].lower()}{error['msg'][1:]}"


def _wrong_kind(context: dict[str, Any]) -> str:
    kinds = re.findall(r"'([^']*)'", context["expected_tags"])
    best = nearest(str(context["tag"]), kinds)
    hint = f" (the nearest is {show(best)})" if best else ""
    return f"is {show(context['tag'])}; allowed: {', '.join(map(show, kinds))}{hint}"


def _locate(
    location: Sequence[str | int], record: type[BaseModel]
) -> tuple[list[str | int], list[type[BaseModel]]]:
    """The user's path of a pydantic location (without the tags of unions) and the record types at its end."""
    path: list[str | int] = []
    records, in_container = [record], False
    for place, part in enumerate(location):
        tagged = [r for r in records if "kind" in r.model_fields and r.model_fields["kind"].default == part]
        if in_container:
            in_container = False
        elif len(records) > 1 and tagged and place:
            records = tagged
            continue
        elif owner := next((r for r in records if part in r.model_fields), None):
            annotation = owner.model_fields[str(part)].annotation
            records = _records_in(annotation) or records
            in_container = typing.get_origin(annotation) in (list, dict)
        path.append(part)
    return path, records


def _records_in(annotation: Any) -> list[type[BaseModel]]:
    """All record types that an annotation mentions."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [record for argument in typing.get_args(annotation) for record in _records_in(argument)]


def _with_names(path: Sequence[str | int], data: Any) -> list[str | int]:
    """The path with list positions replaced by the names of the entries that have one."""
    named: list[str | int] = []
    for part in path:
        try:
            inside: Any = data
            data = (
                inside[part] if isinstance(data, (Mapping, list, tuple)) else getattr(data, str(part), None)
            )
        except (LookupError, TypeError):
            data = None
        name = data.get("name") if isinstance(data, Mapping) else getattr(data, "name", None)
        named.append(name if isinstance(part, int) and isinstance(name, str) and name else part)
    return named
