"""The camera in both its forms: the document's canvas and eye, and look-at (document, section 7)."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, model_validator
from typing_extensions import Self

from tracer.messages import Refusal
from tracer.records import PLAIN, Direction, Fraction, Positive, Real, Record, SampleCount, Seed, Vec2, Vec3

LOOK_AT_KEYS = ("origin", "target", "fov", "up")
CANVAS_KEYS = ("position", "rotate", "pixel_size")
DEFAULT_DISTANCE = 800.0
LARGEST_SIDE = 65535
LARGEST_PICTURE = 2**30
PARALLEL = 1e-6  # sine of the angle between `up` and the view below which they count as parallel

Side = Annotated[int, Field(strict=True, ge=1, le=LARGEST_SIDE), PLAIN]


class DepthOfField(Record):
    """The filter over the finished picture (document, section 8)."""

    focus: Real = Field(
        description="depth (distance from the canvas along the ray) that is sharp; negative: off; 0: refused"
    )
    samples: SampleCount = Field(default=30, description="draws per pixel")
    depth_range: Positive | None = Field(
        default=None, description="pixels whose distance differs by less may mix (default 0.1·focus)"
    )
    seed: Seed = Field(default=0, description="seed of the draws")

    @model_validator(mode="after")
    def _focus_not_zero(self) -> Self:
        if self.focus == 0:
            raise Refusal("is 0; allowed: a positive distance, or a negative number for no filter", "focus")
        return self


class Camera(Record):
    """The canvas form (position, rotate, pixel_size) or the look-at form (origin, target, up, fov)."""

    resolution: tuple[Side, Side] = Field(
        default=(640, 480), description="width and height, in pixels; at most 2^30 in all"
    )
    distance: Positive | None = Field(
        default=None,
        description="from the eye to the canvas center, in scene units "
        "(default 800; look-at form: 1e-3·|target - origin|)",
    )
    pixel_size: Positive = Field(default=1.0, description="edge of a pixel, in scene units; canvas form")
    position: Vec3 = Field(
        default=(0.0, 0.0, 0.0), description="canvas center (what move() adds up to); canvas form"
    )
    rotate: Vec2 = Field(
        default=(0.0, 0.0),
        description="x_rotate, y_rotate in degrees, in this order, positive left and up; canvas form",
    )
    origin: Vec3 | None = Field(default=None, description="the eye; look-at form")
    target: Vec3 | None = Field(default=None, description="the point looked at; look-at form")
    up: Direction = Field(
        default=(0.0, 1.0, 0.0), description="direction that is up in the picture; look-at form"
    )
    fov: Annotated[float, Field(strict=True, gt=0, lt=180), PLAIN] | None = Field(
        default=None, description="vertical field of view in degrees; look-at form"
    )
    supersample: Annotated[int, Field(strict=True, ge=1, le=64), PLAIN] = Field(
        default=1, description="n: a pixel is the mean of n² rays"
    )
    pixel_offset: Fraction | None = Field(
        default=None, description="place of the ray in its pixel (default 0.5; 0 in a `literal` scene)"
    )
    depth_of_field: DepthOfField | None = Field(default=None, description="leave out for none")

    @property
    def is_look_at(self) -> bool:
        """Whether this is the look-at form."""
        return self.origin is not None

    @property
    def eye_distance(self) -> float:
        """Distance from the eye to the canvas center, with the default filled in."""
        if self.distance is not None:
            return self.distance
        if self.origin is None or self.target is None:
            return DEFAULT_DISTANCE
        return 1e-3 * math.dist(self.origin, self.target)

    @model_validator(mode="after")
    def _pixels_fit(self) -> Self:
        width, height = self.resolution
        if width * height > LARGEST_PICTURE:
            raise Refusal(
                f"is {width} × {height}, {width * height} pixels; allowed: at most {LARGEST_PICTURE} in all",
                "resolution",
            )
        return self

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        look_at = [
            key for key in LOOK_AT_KEYS if key in self.model_fields_set and getattr(self, key) is not None
        ]
        if not look_at:
            return self
        canvas = [key for key in CANVAS_KEYS if key in self.model_fields_set]
        if canvas:
            raise Refusal(
                f"belongs to the canvas form and `{look_at[0]}` to the look-at form; allowed: one form",
                canvas[0],
            )
        for key in ("origin", "target", "fov"):
            if getattr(self, key) is None:
                raise Refusal(f"is missing; the look-at form (here by `{look_at[0]}`) needs it", key)
        return self

    @model_validator(mode="after")
    def _view_is_defined(self) -> Self:
        if self.origin is None or self.target is None:
            return self
        view = [t - o for t, o in zip(self.target, self.origin, strict=True)]
        if not any(view):
            raise Refusal("is the same point as `origin`; allowed: another point", "target")
        if _sine(view, self.up) < PARALLEL:
            raise Refusal(
                "is parallel to the view from `origin` to `target`; allowed: another direction", "up"
            )
        return self


def _sine(a: list[float] | Vec3, b: list[float] | Vec3) -> float:
    """Sine of the angle between two directions of any length (scaled first: squares must not overflow)."""
    a_max, b_max = max(map(abs, a)), max(map(abs, b))
    (ax, ay, az), (bx, by, bz) = [c / a_max for c in a], [c / b_max for c in b]
    cross = math.hypot(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)
    return cross / (math.hypot(ax, ay, az) * math.hypot(bx, by, bz))
