"""The one place that knows llvm and cuda, single and double precision, with and without gradients.

A `Backend` is a record of Dr.Jit types. Every numerical function takes its types from the backend (or from
its arguments), never from a global, so that the same code runs in every combination.
"""

from __future__ import annotations

import importlib
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Literal

import drjit as dr
import numpy as np

from tracer.errors import MachineError, UsageError
from tracer.llvm import ensure_llvm, start_drjit
from tracer.subnormals import flushed_subnormals

if TYPE_CHECKING:
    from collections.abc import Iterator

BackendName = Literal["llvm", "cuda"]
Precision = Literal["single", "double"]

INVALID = 0xFFFFFFFF
"""Marks "no primitive", "no shape" wherever ids are unsigned."""

CACHE_LINE = 64
"""Bytes."""


@dataclass(frozen=True)
class Backend:
    """The Dr.Jit types of one combination of backend, precision and differentiability.

    `FloatN`, `SingleN` and `IdN` are vectors of any length, `SingleN` in single precision in either case;
    `epsilon` is the unit roundoff: 2^-24 in single, 2^-53 in double precision.
    """

    name: BackendName
    precision: Precision
    Float: Any
    Vector2: Any
    Vector3: Any
    Vector4: Any
    FloatN: Any
    SingleN: Any
    IdN: Any
    IdVector4: Any
    UInt32: Any
    Int32: Any
    UInt64: Any
    Bool: Any
    epsilon: float

    @property
    def dtype(self) -> type[np.floating[Any]]:
        """NumPy's type of `Float`."""
        return np.float32 if self.precision == "single" else np.float64

    def opaque(self, value: float) -> Any:
        """A width-1 number that kernels read from memory: changing it compiles nothing new."""
        return dr.opaque(self.Float, float(value))

    def opaque_id(self, value: int) -> Any:
        """A width-1 unsigned integer that kernels read from memory."""
        return dr.opaque(self.UInt32, int(value))

    def opaque_vector(self, value: Any) -> Any:
        """A width-1 3-vector that kernels read from memory."""
        x, y, z = (float(c) for c in value)
        return self.Vector3(self.opaque(x), self.opaque(y), self.opaque(z))

    def table(self, rows: Any) -> Any:
        """Uploads numbers as a flat `Float` table in aligned memory that Dr.Jit owns.

        Only such memory is read in whole packets; a zero-copy view of NumPy's memory is not, at half the
        speed.
        """
        return _aligned(self.Float, np.asarray(rows, self.dtype), self.UInt32)

    def single_table(self, rows: Any) -> Any:
        """Uploads numbers in single precision, whatever the precision of `Float`, like `table`."""
        return _aligned(dr.value_t(self.SingleN), np.asarray(rows, np.float32), self.UInt32)

    def id_table(self, ids: Any) -> Any:
        """Uploads unsigned integers, like `table`."""
        return _aligned(self.UInt32, np.asarray(ids, np.uint32), self.UInt32)


def _aligned(array_type: Any, values: np.ndarray, index_type: Any) -> Any:
    source = array_type(_on_a_line(values))
    target = dr.empty(array_type, len(source))
    dr.scatter(target, source, dr.arange(index_type, len(source)))
    dr.eval(target)
    return target


def _on_a_line(values: np.ndarray) -> np.ndarray:
    """A flat copy that begins where a line of the cache does. NumPy's own memory begins there now and then,
    and for each of the two cases Dr.Jit would compile a kernel of its own."""
    room = np.empty(values.nbytes + CACHE_LINE, np.uint8)
    first = -room.ctypes.data % CACHE_LINE
    copy = room[first : first + values.nbytes].view(values.dtype)
    copy.reshape(values.shape)[...] = values
    return copy


def find_backend(name: str = "auto", precision: str = "single", gradients: bool = False) -> Backend:
    """The backend of that name; `"auto"` takes CUDA where a GPU answers, else LLVM.

    Raises `UsageError` for an unknown name, `MachineError` when the machine lacks the backend.
    """
    if name not in ("auto", "llvm", "cuda"):
        raise UsageError(f"backend: {name!r} is unknown; allowed are auto, llvm and cuda")
    if precision not in ("single", "double"):
        raise UsageError(f"precision: {precision!r} is unknown; allowed are single and double")
    if name == "auto":
        name = "cuda" if has_cuda() else "llvm"
    if name == "cuda" and not has_cuda():
        raise MachineError("no NVIDIA GPU with a working driver was found: choose --backend llvm")
    if name == "llvm":
        ensure_llvm()
    return _types(name, precision, gradients)


def has_cuda() -> bool:
    """True where Dr.Jit finds a CUDA driver and a GPU."""
    start_drjit()
    return bool(dr.has_backend(dr.JitBackend.CUDA))


@cache
def _types(name: BackendName, precision: Precision, gradients: bool) -> Backend:
    module = importlib.import_module(f"drjit.{name}.ad" if gradients else f"drjit.{name}")
    suffix = "" if precision == "single" else "64"
    return Backend(
        name=name,
        precision=precision,
        Float=module.Float if precision == "single" else module.Float64,
        Vector2=getattr(module, f"Array2f{suffix}"),
        Vector3=getattr(module, f"Array3f{suffix}"),
        Vector4=getattr(module, f"Array4f{suffix}"),
        FloatN=getattr(module, f"ArrayXf{suffix}"),
        SingleN=module.ArrayXf,
        IdN=module.ArrayXu,
        IdVector4=module.Array4u,
        UInt32=module.UInt32,
        Int32=module.Int32,
        UInt64=module.UInt64,
        Bool=module.Bool,
        epsilon=2.0**-24 if precision == "single" else 2.0**-53,
    )


@contextmanager
def exact_arithmetic() -> Iterator[None]:
    """Division, square root and products as IEEE 754 says: Dr.Jit's fast-math shortcuts are off inside.

    With them `inf * 0` is 0 and GPUs approximate division, which a tracer that promises digits cannot have.
    Subnormal numbers are the exception: they are zero in all threads, where they are in Dr.Jit's.
    """
    with dr.scoped_set_flag(dr.JitFlag.FastMath, False), flushed_subnormals():
        yield


@contextmanager
def thread_count(threads: int | None) -> Iterator[None]:
    """Runs LLVM kernels on so many threads (the caller's included); None leaves Dr.Jit's default."""
    if threads is None:
        yield
        return
    before = dr.thread_count()
    dr.set_thread_count(threads)
    try:
        yield
    finally:
        dr.set_thread_count(before)
