"""The JSON schema of scene files, from which editors complete and the reference page is generated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tracer.scene.description import Scene

_FILE_KEYS: dict[str, Any] = {
    "base": {
        "type": "string",
        "description": "a scene file or built-in name that this file changes: tables merge key by key, "
        "lights and shapes by `name`",
    },
    "remove": {
        "type": "array",
        "items": {"type": "string"},
        "description": "names of lights and shapes of the base that are left out",
    },
}


def json_schema() -> dict[str, Any]:
    """JSON schema (draft 2020-12) of a scene file, with the keys `base` and `remove` that only files have.

    A file over a `base` may state parts of tables, which the base completes: `properties` lets every required
    key be left out, and where there is no `base` the whole tables of `$defs` are asked for as well.
    """
    schema = Scene.model_json_schema(mode="validation")
    definitions, whole = schema["$defs"], schema["properties"]
    for definition in definitions.values():
        if "kind" in definition["properties"]:  # told by a default in Python, but stated in every file
            definition["required"] = ["kind", *definition.get("required", ())]
    parts = {key: _part(value, definitions) for key, value in whole.items()}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "title": "whitted-tracer scene",
        "properties": {**_FILE_KEYS, **parts},
        "if": {"not": {"required": ["base"]}},
        "then": {"properties": {key: value for key, value in whole.items() if value != parts[key]}},
    }


def _part(schema: Any, definitions: Mapping[str, Any]) -> Any:
    """The same schema without required keys, at any depth."""
    if isinstance(schema, list):
        return [_part(each, definitions) for each in schema]
    if not isinstance(schema, dict):
        return schema
    if "$ref" in schema:
        schema = {**definitions[schema["$ref"].rpartition("/")[2]], **schema}
    part = {key: value for key, value in schema.items() if key not in ("$ref", "required", "discriminator")}
    if "oneOf" in part:  # without its kind an entry may be of several
        part["anyOf"] = part.pop("oneOf")
    for key in ("anyOf", "items", "additionalProperties"):
        if key in part:
            part[key] = _part(part[key], definitions)
    if "properties" in part:
        part["properties"] = {key: _part(value, definitions) for key, value in part["properties"].items()}
    return part
