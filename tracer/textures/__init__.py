"""The textures: one file a kind, listed in `TEXTURE_KINDS`; docs/architecture.md says how to add one."""

from __future__ import annotations

from tracer.textures.affine_image import AffineImage
from tracer.textures.base import CellTexture, PictureTexture, TextureRecord
from tracer.textures.checker import Checker
from tracer.textures.image import Image
from tracer.textures.solid import Solid
from tracer.textures.stripes import Stripes

TEXTURE_KINDS: dict[str, type[TextureRecord]] = {
    "solid": Solid,
    "stripes": Stripes,
    "checker": Checker,
    "image": Image,
    "affine_image": AffineImage,
}

__all__ = [
    "TEXTURE_KINDS",
    "AffineImage",
    "CellTexture",
    "Checker",
    "Image",
    "PictureTexture",
    "Solid",
    "Stripes",
    "TextureRecord",
]
