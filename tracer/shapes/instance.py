"""The instance: a mesh of the scene once more, at another place (document, section 5)."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from tracer.records import Flag, Name
from tracer.shapes.base import Scale3, ShapeRecord


class Instance(ShapeRecord):
    """Shares the mesh's triangles before its transform; what is not given here is taken from the mesh."""

    kind: Literal["instance"] = Field(default="instance", description="a mesh of the scene once more")
    of: Name = Field(description="name of the mesh")
    scale: Scale3 = Field(
        default=(1.0, 1.0, 1.0), description="one factor or three (x, y, z), about the origin"
    )
    smooth: Flag | None = Field(default=None, description="as for a mesh (default: that of the mesh)")
