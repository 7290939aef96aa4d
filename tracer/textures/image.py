"""A picture laid along two axes, one texel a scene unit: the document's `pic_grain` (document, section 6)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from tracer.textures.base import PictureTexture


class Image(PictureTexture):
    """(u, v) = (x, y), (y, z) or (x, z) in texels."""

    kind: Literal["image"] = Field(default="image", description="a picture, one texel a scene unit")
    direction: Literal["xy", "yz", "xz"] = Field(
        default="xy", description="the two coordinates that are u and v"
    )

    def texel_matrix(self) -> np.ndarray:
        """(2, 4): (u, v) = M (x, y, z, 1) in texels."""
        matrix = np.zeros((2, 4))
        matrix[[0, 1], ["xyz".index(axis) for axis in self.direction]] = 1
        return matrix
