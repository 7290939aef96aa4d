"""What textures share: the cell rule and the look-up options of pictures (document, section 6)."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator
from typing_extensions import Self

from tracer.messages import Refusal
from tracer.records import FileName, Flag, Record

PICTURE_SUFFIXES = (".png", ".jpg", ".jpeg")


class TextureRecord(Record):
    """Base of the textures: a map from a point in space to a color."""

    kind: str


class CellTexture(TextureRecord):
    """What textures made of cells have."""

    index: Literal["floor", "truncate"] | None = Field(
        default=None,
        description="how a coordinate becomes a cell (default floor; truncate in a `literal` scene)",
    )


class PictureTexture(CellTexture):
    """What textures from a picture file have."""

    file: FileName = Field(description="a PNG or JPEG file, relative to the scene file")
    flip_v: Flag | None = Field(
        default=None,
        description="first row of the file at v = 0 (default false: upright; true in a `literal` scene)",
    )
    filter: Literal["nearest", "bilinear"] = Field(default="nearest", description="look-up between texels")

    @model_validator(mode="after")
    def _file_type(self) -> Self:
        if not self.file.lower().endswith(PICTURE_SUFFIXES):
            raise Refusal(f'is "{self.file}"; allowed: a file that ends in .png, .jpg or .jpeg', "file")
        return self
