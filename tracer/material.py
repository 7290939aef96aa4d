"""The material: how a surface splits the light it receives (document, sections 2 and 3)."""

from __future__ import annotations

from pydantic import Field, model_validator
from typing_extensions import Self

from tracer.messages import Refusal
from tracer.records import NonNegative, Positive, Record

SHARE_TOLERANCE = 1e-9  # k_r + k_t may exceed 1 by the rounding of decimal numbers


class Material(Record):
    """The document's `lproperty`; a shape without material has these defaults."""

    ior: Positive = Field(
        default=1.0, description="index of refraction of the inside; the outside is always 1"
    )
    reflection: NonNegative = Field(
        default=0.0, description="share k_r of the mirrored ray; k_r + k_t is at most 1"
    )
    refraction: NonNegative = Field(
        default=0.0, description="share k_t of the refracted ray; k_r + k_t is at most 1"
    )
    diffuse: NonNegative = Field(default=1.0, description="factor m of the diffuse term")
    specular: NonNegative = Field(default=0.0, description="factor h of the highlight")
    shininess: NonNegative = Field(default=1.0, description="exponent s of the highlight")

    @model_validator(mode="after")
    def _shares_fit(self) -> Self:
        if self.reflection + self.refraction > 1 + SHARE_TOLERANCE:
            raise Refusal(
                f"{self.reflection:g} and `refraction` {self.refraction:g} add up to more than 1; "
                "allowed: reflection + refraction at most 1",
                "reflection",
            )
        return self

    @property
    def absorption(self) -> float:
        """Share k_a = max(0, 1 - k_r - k_t) of the local light."""
        return max(0.0, 1.0 - self.reflection - self.refraction)
