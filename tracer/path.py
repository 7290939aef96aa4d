"""The ray in hand: what the recursion must remember of a ray that is still to be traced (document, section
3)."""

from __future__ import annotations

from dataclasses import make_dataclass
from functools import cache
from typing import Any

from tracer.backends import Backend
from tracer.ray import Ray


@cache
def path_type(backend: Backend, has_view: bool) -> Any:
    """The record type of a path: made per backend, since Dr.Jit reads the field types of what it keeps on a
    stack.

    Fields: the ray (`o`, `d`, `departure`, `sides`, and `view` where the scene has meshes), `weight` (product
    of the k's so far, for the cut-off), `throughput` (3, n; what its light is worth) and `level` (0 for a
    primary ray).
    """
    fields = [
        ("o", backend.Vector3),
        ("d", backend.Vector3),
        ("departure", backend.UInt32),
        ("sides", backend.UInt32),
        ("weight", backend.Float),
        ("throughput", backend.Vector3),
        ("level", backend.UInt32),
    ]
    if has_view:
        fields.append(("view", backend.Vector3))
    return make_dataclass("Path", fields, namespace={"ray": property(_ray)})


def _ray(path: Any) -> Ray:
    return Ray(path.o, path.d, path.departure, path.sides, getattr(path, "view", None))


def make_path(backend: Backend, ray: Ray, weight: Any, throughput: Any, level: Any) -> Any:
    """A path record from its parts."""
    record = path_type(backend, ray.view is not None)
    view = () if ray.view is None else (ray.view,)
    return record(ray.o, ray.d, ray.departure, ray.sides, weight, throughput, level, *view)
