"""What all shapes have: a name, a surface and a place (document, sections 5 and 6)."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator
from typing_extensions import Self

from tracer.messages import Refusal
from tracer.placement import Placement
from tracer.records import Color, Name, Positive, Record, Vec3, plain


def _three_factors(value: Any) -> Any:
    """One number scales all three axes alike."""
    value = plain(value)
    return (value,) * 3 if isinstance(value, (int, float)) and not isinstance(value, bool) else value


Factors = tuple[Positive, Positive, Positive]
Scale3 = Annotated[Factors, BeforeValidator(_three_factors, json_schema_input_type=Positive | Factors)]


class ShapeRecord(Record):
    """Base of the shapes; the placement is applied in the order scale, rotate, translate."""

    kind: str
    name: Name | None = Field(default=None, description="used in messages, reports, `base` and `of`")
    material: Name | None = Field(
        default=None, description="name of a material; without one: the default material"
    )
    texture: Name | None = Field(default=None, description="name of a texture; excludes `color`")
    color: Color | None = Field(
        default=None, description="one color all over (default white); excludes `texture`"
    )
    rotate: Vec3 = Field(
        default=(0.0, 0.0, 0.0), description="degrees about x, then y, then z, right-handed, about the origin"
    )
    translate: Vec3 = Field(default=(0.0, 0.0, 0.0), description="shift in scene units")
    texture_space: Literal["world", "object"] | None = Field(
        default=None,
        description="the texture's argument: the world point, or the point before scale, rotate, translate "
        "(default world; for an instance that of its mesh)",
    )

    @model_validator(mode="after")
    def _one_surface_color(self) -> Self:
        if self.texture is not None and self.color is not None:
            raise Refusal("and `color` are both given; allowed: one of them", "texture")
        return self

    @property
    def placement(self) -> Placement:
        """Where the shape stands."""
        return Placement.of(getattr(self, "scale", 1.0), self.rotate, self.translate)
