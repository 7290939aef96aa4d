"""The lights: points, and areas that stand for sets of points (document, section 4).

A new kind is one record here and one line in `LIGHT_KINDS`.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from tracer.records import Color, Direction, Flag, Name, NonNegative, Positive, Record, SampleCount, Vec3


class LightRecord(Record):
    """What all lights have."""

    kind: str
    name: Name | None = Field(default=None, description="used in messages and by `base`")
    weight: NonNegative = Field(
        default=1.0, description="share of this light; all weights are scaled to the sum 1"
    )
    color: Color = Field(
        default=(1.0, 1.0, 1.0), description="factor of the light's terms, channel by channel"
    )


class PointLight(LightRecord):
    """A point that shines to all sides, without fall-off; it cannot be seen."""

    kind: Literal["point"] = Field(default="point", description="a single point")
    position: Vec3 = Field(description="the point, in scene units")


class AreaLight(LightRecord):
    """What the lights made of many points have; each sample weighs weight/samples."""

    center: Vec3 = Field(description="center, in scene units")
    samples: SampleCount = Field(default=16, description="number of points that stand for the area")
    jitter: Flag = Field(
        default=False, description="shift the pattern at random from pixel to pixel: noise, not bands"
    )


class RingLight(AreaLight):
    """Points on a circle."""

    kind: Literal["ring"] = Field(default="ring", description="points on a circle")
    normal: Direction = Field(description="normal of the circle's plane")
    radius: Positive = Field(description="radius of the circle, in scene units")


class DiskLight(AreaLight):
    """Points in a disk."""

    kind: Literal["disk"] = Field(default="disk", description="points in a disk")
    normal: Direction = Field(description="normal of the disk's plane")
    radius: Positive = Field(description="radius of the disk, in scene units")


class SphereLight(AreaLight):
    """Points on a sphere."""

    kind: Literal["sphere"] = Field(default="sphere", description="points on a sphere")
    radius: Positive = Field(description="radius of the sphere, in scene units")


class RectangleLight(AreaLight):
    """Points in a rectangle."""

    kind: Literal["rectangle"] = Field(default="rectangle", description="points in a rectangle")
    normal: Direction = Field(description="normal of the rectangle's plane")
    size: Annotated[tuple[Positive, Positive], Field(description="width and height, in scene units")]


LIGHT_KINDS: dict[str, type[LightRecord]] = {
    "point": PointLight,
    "ring": RingLight,
    "disk": DiskLight,
    "sphere": SphereLight,
    "rectangle": RectangleLight,
}
