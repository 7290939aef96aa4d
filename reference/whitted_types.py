"""Dr.Jit and the types that Mitsuba's variant `llvm_ad_rgb` computes with, for `reference.whitted`."""

from __future__ import annotations

import tracer  # noqa: F401  # chooses the LLVM library, which Dr.Jit looks for when it is imported

# isort: split
import drjit as dr
from drjit.llvm.ad import Array3f, Array4f, Bool, Float, UInt32, UInt64

__all__ = ["Array3f", "Array4f", "Bool", "Float", "UInt32", "UInt64", "dr"]
