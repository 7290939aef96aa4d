"""A Whitted ray tracer, vectorized with Dr.Jit, that you can trust to the last digit.

`load` reads a scene, `render` makes a picture, `intersect`, `visible` and `trace_path` answer plain ray queries.
"""

from tracer.llvm import select_llvm

select_llvm()  # before anything imports Dr.Jit, which reads the choice only once

from tracer.errors import MachineError, OutputError, SceneError, TracerError, UsageError  # noqa: E402
from tracer.film.result import Result  # noqa: E402
from tracer.queries import Hits, Paths, intersect, trace_path, visible  # noqa: E402
from tracer.render import RenderInterrupted, render  # noqa: E402
from tracer.scene import Scene, json_schema, load  # noqa: E402
from tracer.version import __version__  # noqa: E402

__all__ = [
    "Hits",
    "MachineError",
    "OutputError",
    "Paths",
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
    "render",
    "trace_path",
    "visible",
]
