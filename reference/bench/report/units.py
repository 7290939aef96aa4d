"""Times, rates and ratios as people read them."""

from __future__ import annotations

from math import isnan

NOTHING = "–"


def duration(seconds: float) -> str:
    """Three digits with their unit, or a dash."""
    if isnan(seconds):
        return NOTHING
    for size, unit in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")):
        if seconds >= size:
            return f"{_three(seconds / size)} {unit}"
    return "0 s" if seconds == 0 else f"{seconds:.0e} s"


def ratio(value: float) -> str:
    """How many times, with three digits at most, or a dash."""
    return NOTHING if isnan(value) else _three(value)


def million(rate: float) -> str:
    """Millions a second."""
    return NOTHING if isnan(rate) else _three(rate / 1e6)


def mebibytes(size: float) -> str:
    """Memory."""
    return NOTHING if isnan(size) else f"{size:,.0f} MiB"


def _three(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.1f}" if value >= 10 else f"{value:.2f}"
