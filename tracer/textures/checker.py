"""Three-dimensional checks: the document's `cube_grain` (document, section 6)."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from tracer.ray import max_abs
from tracer.records import Color, Positive
from tracer.textures.base import CellTexture
from tracer.textures.cells import CellRule, modulo


class Checker(CellTexture):
    """Color number (F(x/I) + F(y/I) + F(z/I)) mod 2 for the interval I."""

    kind: Literal["checker"] = Field(default="checker", description="cubes of two colors")
    colors: tuple[Color, Color] = Field(description="the two colors")
    interval: Positive = Field(description="edge of a cube, in scene units")


def checker_number(rule: CellRule, p: Any, rate: Any) -> Any:
    """Number of the color at point p (3, n): (F(x/I) + F(y/I) + F(z/I)) mod 2, with rate = 1/I."""
    largest = max_abs(p) * rate
    cell = sum(rule.cell(coordinate * rate, largest) for coordinate in p)
    return modulo(rule.magnitude(cell), type(largest)(2))
