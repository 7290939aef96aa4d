"""A picture placed by a 2×3 matrix: the document's `high_grain` (document, section 6)."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from tracer.records import PLAIN, Vec2, Vec3
from tracer.textures.base import PictureTexture


class AffineImage(PictureTexture):
    """(u, v) = M·p + offset in texels."""

    kind: Literal["affine_image"] = Field(default="affine_image", description="a picture placed by a matrix")
    matrix: Annotated[tuple[Vec3, Vec3], PLAIN] = Field(
        description="2×3 matrix M, row by row; texels per scene unit"
    )
    offset: Vec2 = Field(default=(0.0, 0.0), description="added to M·p, in texels")

    def texel_matrix(self) -> np.ndarray:
        """(2, 4): (u, v) = M (x, y, z, 1) in texels."""
        return np.column_stack([self.matrix, self.offset])
