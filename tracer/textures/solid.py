"""One color all over: the document's `single_grain` (document, section 6)."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from tracer.records import Color
from tracer.textures.base import TextureRecord


class Solid(TextureRecord):
    """One color."""

    kind: Literal["solid"] = Field(default="solid", description="one color all over")
    color: Color = Field(description="the color")
