"""The base of all records of a scene and the types of their fields.

Numbers are finite and strict (a string or a truth value is no number; an integer may stand for a real one).
NumPy scalars and arrays are taken as the plain numbers they hold. Colors are display-referred sRGB in 0..1,
angles are in degrees, lengths in scene units (document, section 9 and the head of the model).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import reduce
from operator import or_
from pathlib import PurePath
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainSerializer,
    SerializerFunctionWrapHandler,
    StrictBool,
    ValidationError,
    WithJsonSchema,
    model_serializer,
)

from tracer.errors import SceneError
from tracer.messages import Refusal, show
from tracer.validation import validation_sentence

COLOR_FORMS = '"#rrggbb", "#rgb" or [r, g, b] with three numbers from 0 to 1'


class Record(BaseModel):
    """Base of all records: unknown keys are refused, and assignments are checked like constructor arguments.

    Wrong values raise `SceneError` with one sentence; an assignment that is refused changes nothing.
    """

    model_config = ConfigDict(
        extra="forbid", validate_assignment=True, allow_inf_nan=False, hide_input_in_errors=True
    )

    def __init__(self, /, **data: Any) -> None:
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise SceneError(validation_sentence(error, type(self), data, type(self).__name__)) from None

    # Says to pydantic that nested records need not be built through this constructor, as in BaseModel itself.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    def __setattr__(self, name: str, value: Any) -> None:
        values, given = dict(self.__dict__), set(self.model_fields_set)
        try:
            super().__setattr__(name, value)
        except ValidationError as error:
            object.__setattr__(self, "__dict__", values)
            object.__setattr__(self, "__pydantic_fields_set__", given)
            sentence = validation_sentence(error, type(self), {name: value}, type(self).__name__)
            raise SceneError(sentence) from None

    @model_serializer(mode="wrap")
    def _only_what_is_said(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Keep the keys that were given or differ from their default; TOML has no word for None."""
        fields = type(self).model_fields
        return {
            key: value
            for key, value in handler(self).items()
            if value is not None
            and (
                key in ("kind", "version")
                or key in self.model_fields_set
                or getattr(self, key) != fields[key].get_default(call_default_factory=True)
            )
        }

    def to_dict(self) -> dict[str, Any]:
        """This record as plain dicts, lists, strings and numbers that TOML can hold, without loss."""
        return self.model_dump(mode="json")


def plain(value: Any) -> Any:
    """A NumPy scalar or array as plain numbers and lists; everything else as it is."""
    return value.tolist() if hasattr(value, "tolist") else value


def refuse_flag(value: Any) -> Any:
    """Refuse true, which Python takes for 1."""
    if isinstance(value, bool):
        raise Refusal(f"is {show(value)}; allowed: a whole number")
    return value


def union_of(kinds: Mapping[str, type[Record]]) -> Any:
    """The field type "one of these kinds", told apart by the key `kind`."""
    return Annotated[reduce(or_, kinds.values()), Field(discriminator="kind")]


def _not_zero(direction: tuple[float, float, float]) -> tuple[float, float, float]:
    if not any(direction):
        raise Refusal("is [0, 0, 0]; allowed: a direction that is not zero (its length does not matter)")
    return direction


def parse_color(value: Any) -> Any:
    """The three channels of a color as text; lists are left to the checks of their numbers."""
    value = plain(value)
    if isinstance(value, str) and re.fullmatch(r"#([0-9a-fA-F]{3}|[0-9a-fA-F]{6})", value):
        digits = value[1:] if len(value) == 7 else "".join(2 * digit for digit in value[1:])
        return tuple(int(digits[i : i + 2], 16) / 255 for i in (0, 2, 4))
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        raise Refusal(f"is {show(value)}; allowed: {COLOR_FORMS}")
    return value


def color_to_toml(color: Sequence[float]) -> str | list[float]:
    """`#rrggbb` where that gives back exactly the same numbers, else the numbers."""
    bytes_ = [round(channel * 255) for channel in color]
    if all(byte / 255 == channel for byte, channel in zip(bytes_, color, strict=True)):
        return "#{:02x}{:02x}{:02x}".format(*bytes_)
    return list(color)


_COLOR_SCHEMA = {
    "anyOf": [
        {"type": "string", "pattern": "^#([0-9a-fA-F]{3}|[0-9a-fA-F]{6})$"},
        {
            "type": "array",
            "items": {"type": "number", "minimum": 0, "maximum": 1},
            "minItems": 3,
            "maxItems": 3,
        },
    ]
}

LARGEST_NUMBER = 1e18  # its square is finite in single precision
PLAIN = BeforeValidator(plain)

Real = Annotated[float, Field(strict=True, ge=-LARGEST_NUMBER, le=LARGEST_NUMBER), PLAIN]
Positive = Annotated[float, Field(strict=True, gt=0, le=LARGEST_NUMBER), PLAIN]
NonNegative = Annotated[float, Field(strict=True, ge=0, le=LARGEST_NUMBER), PLAIN]
Fraction = Annotated[float, Field(strict=True, ge=0, le=1), PLAIN]
Seed = Annotated[int, Field(strict=True, ge=0, le=2**63 - 1), PLAIN]
SampleCount = Annotated[int, Field(strict=True, ge=1, le=65536), PLAIN]
Flag = StrictBool
Name = Annotated[str, Field(strict=True, min_length=1, max_length=200)]
FileName = Annotated[
    str,
    Field(strict=True, min_length=1, max_length=4096),
    BeforeValidator(lambda value: value.as_posix() if isinstance(value, PurePath) else value),
]

Vec2 = Annotated[tuple[Real, Real], PLAIN]
Vec3 = Annotated[tuple[Real, Real, Real], PLAIN]
Vec4 = Annotated[tuple[Real, Real, Real, Real], PLAIN]
Direction = Annotated[Vec3, AfterValidator(_not_zero)]
Color = Annotated[
    tuple[Fraction, Fraction, Fraction],
    BeforeValidator(parse_color),
    PlainSerializer(color_to_toml, when_used="json"),
    WithJsonSchema(_COLOR_SCHEMA),
]
