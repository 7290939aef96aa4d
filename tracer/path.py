"""The ray in hand: what the recursion must remember of a ray that is still to be traced (document, section 3)."""

from __future__ import annotations

from dataclasses import make_dataclass
from functools import cache
from typing import Any

from tracer.backends import Backend
from tracer.ray import Ray


@cache
def path_type(backend: Backend) -> Any:
    """The record type of a path: made per backend, since Dr.Jit reads the field types of what it keeps on a stack.

    Fields: the ray (`o`, `d`, `departure`, `sides`), `weight` (product of the k's so far, for the cut-off),
    `throughput` (3, n; what its light is worth) and `level` (0 for a primary ray).
    """
    return make_dataclass(
        "Path",
        [
            ("o", backend.Vector3),
            ("d", backend.Vector3),
            ("departure", backend.UInt32),
            ("sides", backend.UInt32),
            ("weight", backend.Float),
            ("throughput", backend.Vector3),
            ("level", backend.UInt32),
        ],
        namespace={"ray": property(lambda path: Ray(path.o, path.d, path.departure, path.sides))},
    )


def make_path(backend: Backend, ray: Ray, weight: Any, throughput: Any, level: Any) -> Any:
    """A path record from its parts."""
    return path_type(backend)(ray.o, ray.d, ray.departure, ray.sides, weight, throughput, level)
