"""Stripes across the diagonal x + y + z: the document's `line_grain` (document, section 6)."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from tracer.ray import max_abs
from tracer.records import Color, Positive
from tracer.textures.base import CellTexture
from tracer.textures.cells import CellRule, modulo


class Stripes(CellTexture):
    """Color number F((x + y + z)/interval) mod n."""

    kind: Literal["stripes"] = Field(default="stripes", description="stripes across x + y + z")
    colors: Annotated[tuple[Color, ...], Field(min_length=2, max_length=4096)] = Field(
        description="two colors or more, in turn"
    )
    interval: Positive = Field(description="width of a stripe along x, y or z, in scene units")


def stripe_number(rule: CellRule, p: Any, rate: Any, colors: Any) -> Any:
    """Number of the color at point p (3, n): F((x + y + z) rate) mod colors, with rate = 1/interval."""
    cell = rule.cell((p.x + p.y + p.z) * rate, max_abs(p) * rate)
    return modulo(rule.magnitude(cell), colors)
