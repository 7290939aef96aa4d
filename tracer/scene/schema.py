"""The JSON schema of scene files, from which editors complete and the reference page is generated."""

from __future__ import annotations

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
    """JSON schema (draft 2020-12) of a scene file, with the keys `base` and `remove` that only files have."""
    schema = Scene.model_json_schema(mode="validation")
    schema["properties"] = {**_FILE_KEYS, **schema["properties"]}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "title": "whitted-tracer scene",
    }
