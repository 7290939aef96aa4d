"""A Whitted ray tracer, vectorized with Dr.Jit, that you can trust to the last digit.

`load` reads a scene, `render` makes a picture, `pixel_tree` takes one pixel apart, `intersect`,
`visible` and `trace_path` answer plain ray queries. The public names are imported when they are first
used (PEP 562), so that `tracer --help` need not wait for Dr.Jit.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

from tracer.llvm import select_llvm

if TYPE_CHECKING:
    from tracer.chains import Paths, trace_path
    from tracer.errors import MachineError, OutputError, SceneError, TracerError, UsageError
    from tracer.film.result import Result
    from tracer.lens import pixel_tree
    from tracer.queries import Hits, intersect, visible
    from tracer.ray_tree import PixelTree, RayNode
    from tracer.render import RenderInterrupted, render
    from tracer.scene import Scene, json_schema, load
    from tracer.version import __version__

__all__ = [
    "Hits",
    "MachineError",
    "OutputError",
    "Paths",
    "PixelTree",
    "RayNode",
    "RenderInterrupted",
    "Result",
    "Scene",
    "SceneError",
    "TracerError",
    "UsageError",
    "__version__",
    "intersect",
    "json_schema",
    "load",
    "pixel_tree",
    "render",
    "trace_path",
    "visible",
]

_NAMES_OF_MODULES = {
    "tracer.chains": ("Paths", "trace_path"),
    "tracer.errors": ("MachineError", "OutputError", "SceneError", "TracerError", "UsageError"),
    "tracer.film.result": ("Result",),
    "tracer.lens": ("pixel_tree",),
    "tracer.ray_tree": ("PixelTree", "RayNode"),
    "tracer.queries": ("Hits", "intersect", "visible"),
    "tracer.render": ("RenderInterrupted", "render"),
    "tracer.scene": ("Scene", "json_schema", "load"),
    "tracer.version": ("__version__",),
}
_HOMES = {name: module for module, names in _NAMES_OF_MODULES.items() for name in names}


class _Package(ModuleType):
    """This package: `tracer.render` is the function, also after the module of that name was imported."""

    def __setattr__(self, name: str, value: Any) -> None:
        if isinstance(value, ModuleType) and _HOMES.get(name) == value.__name__:
            value = getattr(value, name)
        super().__setattr__(name, value)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


sys.modules[__name__].__class__ = _Package
select_llvm()  # before anything below this package imports Dr.Jit, which reads the choice only once
