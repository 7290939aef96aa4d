"""Numbers and units as people read them."""

from __future__ import annotations

import re
from math import isinf, isnan

SYMBOLS = {"eps": "ε", "eta": "η", "theta": "θ", "sqrt": "√"}
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
NOTHING = "–"


def number(value: float) -> str:
    """Three digits, fewer where the rest are zeros; counts in full, in groups of thousands; a dash for what
    does not exist."""
    if isnan(value):
        return NOTHING
    if isinf(value):
        return "∞" if value > 0 else "−∞"
    if value == int(value) and abs(value) < 1e9:
        return f"{int(value):,}".replace("-", "−")
    digits = next(digits for digits in (0, 1, 2) if digits == 2 or float(f"{value:.{digits}e}") == value)
    if 1e-3 <= abs(value) < 1e4:
        text = f"{value:,.0f}" if abs(value) >= 100 else f"{value:#.{digits + 1}g}".removesuffix(".")
    else:
        factor, _, exponent = f"{value:.{digits}e}".partition("e")
        power = f"10{str(int(exponent)).translate(SUPERSCRIPTS)}"
        text = power if factor == "1" else f"{factor}·{power}"
    return text.replace("-", "−")


def count(value: float) -> str:
    """A count that is large: with millions and thousands as words of one letter."""
    for size, letter in ((1e9, "G"), (1e6, "M")):
        if value >= size:
            return f"{value / size:#.3g} {letter}"
    return number(value)


def percent(share: float) -> str:
    """A share of an allowance; what is not 0 never becomes 0."""
    if isnan(share):
        return NOTHING
    if isinf(share):
        return "∞"
    if share == 0:
        return "0 %"
    return (
        "< 0.1 %" if share < 1e-3 else f"{100 * share:.1f} %" if share < 0.0995 else f"{100 * share:,.0f} %"
    )


def times(margin: float) -> str:
    """A margin, such as `5.3 ×`."""
    return NOTHING if isnan(margin) else "∞" if isinf(margin) else f"{number(margin)} ×"


def unit(text: str) -> str:
    """A unit of the table of tolerances with Greek letters and signs instead of their names."""
    for name, symbol in SYMBOLS.items():
        text = re.sub(rf"(?<![a-z]){name}(?![a-z])", symbol, text)
    return re.sub(r"(?<=\w) x (?=e?\d)", " × ", text.replace("√ ", "√").replace("^2", "²"))
