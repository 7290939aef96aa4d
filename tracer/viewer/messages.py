"""What the page may say, each kind of message a record: anything else is refused before it does anything."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from tracer.errors import UsageError

LONGEST = 4096
"""Bytes of a message."""

Number = Annotated[float, Field(strict=True, ge=-1e18, le=1e18, allow_inf_nan=False)]
Text = Annotated[str, Field(strict=True, max_length=400)]
Share = Annotated[float, Field(strict=True, ge=0, le=1)]


class _Message(BaseModel):
    model_config = ConfigDict(extra="forbid", hide_input_in_errors=True)


class _Change(_Message):
    """Changes what is seen: `stamp` comes back with the first picture that shows it; what belongs to one
    `gesture` is undone as one."""

    stamp: Number = 0.0
    gesture: Number | None = None


class Ack(_Message):
    """The page has drawn a frame, which took it so many `seconds`."""

    kind: Literal["ack"]
    frame: int
    seconds: Number = 0.0


class Grab(_Message):
    """A drag begins."""

    kind: Literal["grab"]


class Orbit(_Change):
    """Degrees around what was grabbed."""

    kind: Literal["orbit"]
    left: Number
    up: Number


class Pan(_Change):
    """Shares of the picture's height."""

    kind: Literal["pan"]
    right: Number
    down: Number


class Dolly(_Change):
    """A share of the way to what was grabbed."""

    kind: Literal["dolly"]
    share: Number


class Rotate(_Change):
    """The document's x_rotate and y_rotate, in degrees."""

    kind: Literal["rotate"]
    x_rotate: Number = 0.0
    y_rotate: Number = 0.0


class Move(_Change):
    """The document's move, in scene units."""

    kind: Literal["move"]
    by: tuple[Number, Number, Number]


class Set(_Change):
    """A slider."""

    kind: Literal["set"]
    name: Text
    value: Number


class Paint(_Change):
    """A color, as #rrggbb."""

    kind: Literal["paint"]
    name: Text
    color: Annotated[str, Field(strict=True, pattern="^#[0-9a-fA-F]{6}$")]


class Choose(_Change):
    """One of the document's choices."""

    kind: Literal["choose"]
    name: Text
    value: Annotated[bool, Field(strict=True)]


class Focus(_Change):
    """Depth of field on or off."""

    kind: Literal["focus"]
    value: Annotated[bool, Field(strict=True)]


class Show(_Change):
    """Another layer."""

    kind: Literal["show"]
    layer: Text


class Reset(_Change):
    """The camera as the scene file has it."""

    kind: Literal["reset"]


class Reload(_Change):
    """The scene file as it is now."""

    kind: Literal["reload"]


class Undo(_Change):
    """The last step back."""

    kind: Literal["undo"]


class Look(_Message):
    """The ray tree of a pixel, given as shares of the picture's width and height."""

    kind: Literal["look"]
    x: Share
    y: Share


class SaveScene(_Message):
    """The scene as TOML."""

    kind: Literal["save_scene"]


class SaveStill(_Message):
    """The picture at full quality."""

    kind: Literal["save_still"]
    suffix: Literal[".png", ".exr"]


class Compare(_Message):
    """Ours, Mitsuba's, and the difference."""

    kind: Literal["compare"]


_KINDS: TypeAdapter[Any] = TypeAdapter(
    Annotated[
        Ack
        | Grab
        | Orbit
        | Pan
        | Dolly
        | Rotate
        | Move
        | Set
        | Paint
        | Choose
        | Focus
        | Show
        | Reset
        | Reload
        | Undo
        | Look
        | SaveScene
        | SaveStill
        | Compare,
        Field(discriminator="kind"),
    ]
)


def parse(text: str | bytes) -> Any:
    """The message that a text is; raises `UsageError` with what is wrong, in one line."""
    if len(text) > LONGEST:
        raise UsageError(f"{len(text)} bytes; allowed: at most {LONGEST}")
    try:
        return _KINDS.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(map(str, first["loc"]))
        raise UsageError(f"{where}: {first['msg']}" if where else str(first["msg"])) from None
