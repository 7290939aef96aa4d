"""The one place that imports Mitsuba and chooses its variant."""

from __future__ import annotations

from typing import Any

from tracer.errors import MachineError
from tracer.llvm import ensure_llvm

VARIANTS = ("llvm_ad_rgb", "scalar_rgb")


def mitsuba(variant: str = "llvm_ad_rgb") -> Any:
    """The module `mitsuba` after that variant was chosen; a usable LLVM is found first.

    Embree traces in single precision in every variant. Raises `MachineError` without Mitsuba, or without an
    LLVM where the variant needs one.
    """
    if variant.startswith("llvm"):
        ensure_llvm()
    try:
        import mitsuba as module
    except ImportError:
        raise MachineError(
            "Mitsuba is not installed; `pip install whitted-tracer[reference]` installs the version that fits"
        ) from None
    if module.variant() != variant:
        module.set_variant(variant)
    return module
