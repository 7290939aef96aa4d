"""Numbers keyed over time: an `[[animation]]` table is a key of the scene and its values at some frames."""

from __future__ import annotations

from bisect import bisect_right
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator
from typing_extensions import Self

from tracer.messages import Refusal, show
from tracer.records import LARGEST_NUMBER, Real, Record, parse_color, plain


def _numbers(value: Any) -> Any:
    """One keyed value as a number or nested tuples of numbers; a color as its three channels."""
    value = plain(value)
    if isinstance(value, str):
        return parse_color(value)
    if isinstance(value, (list, tuple)):
        return tuple(_numbers(entry) for entry in value)
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not is_number or not abs(value) <= LARGEST_NUMBER:
        raise Refusal(f"is {show(value)}; allowed: a number, a color or a list of numbers")
    return float(value)


_NUMBER = {"type": "number"}
_ENTRY = {"anyOf": [_NUMBER, {"type": "array", "items": _NUMBER}]}
KeyedValue = Annotated[
    Any,
    BeforeValidator(_numbers),
    WithJsonSchema({"anyOf": [_NUMBER, {"type": "string"}, {"type": "array", "items": _ENTRY}]}),
]


class Track(Record):
    """A number, vector or color of the scene that changes from frame to frame. Before its first time it has
    the first value, after its last time the last one."""

    key: Annotated[str, Field(strict=True, min_length=1, max_length=1000)] = Field(
        description='path of the key, as for `--set`: `lights.0.weight`, `shapes."my ball".center`'
    )
    times: list[Real] = Field(min_length=1, description="frame numbers, each larger than the one before")
    values: list[KeyedValue] = Field(
        min_length=1, description="what the key is at these times, in the form that the key has"
    )
    interpolation: Literal["linear", "smooth", "constant"] = Field(
        default="linear",
        description="between two times: in a straight line; in a cubic that comes to rest at both ends and "
        "leaves no range; or the earlier value",
    )

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        for number, (before, after) in enumerate(pairwise(self.times), start=1):
            if after <= before:
                raise Refusal(f"is {after:g} after {before:g}; allowed: increasing times", "times", number)
        if len(self.values) != len(self.times):
            raise Refusal(
                f"has {len(self.values)} entries; allowed: {len(self.times)}, one for each of `times`",
                "values",
            )
        for number, value in enumerate(self.values):
            if _shape(value) != _shape(self.values[0]):
                raise Refusal("has another form than the first value", "values", number)
        return self

    def at(self, frame: float) -> Any:
        """The value at a frame, as a float or nested tuples of floats."""
        after = bisect_right(self.times, frame)
        if after == 0 or after == len(self.times) or self.interpolation == "constant":
            return self.values[max(0, after - 1)]
        before = after - 1
        keys = np.array(self.values, np.float64)
        span = self.times[after] - self.times[before]
        share = (frame - self.times[before]) / span
        start, end = keys[before], keys[after]
        if self.interpolation == "smooth":
            times = np.array(self.times)
            speed, end_speed = (_speed(times, keys, key) * span for key in (before, after))
            value = _hermite(start, end, speed, end_speed, share)
        else:
            value = (1 - share) * start + share * end
        # Rounding alone could leave the range, as with a share of 1 + 1e-16.
        return _tuples(np.clip(value, np.minimum(start, end), np.maximum(start, end)))


def _speed(times: NDArray, keys: NDArray, key: int) -> NDArray:
    """The slope of the smooth curve at a key, 0 at both ends and where the values turn.

    In between the weighted harmonic mean of the slopes at both sides, with which no cubic leaves the range of
    its two keys (F. N. Fritsch and J. Butland, SIAM J. Sci. Stat. Comput. 5, 1984).
    """
    if key in (0, len(times) - 1):
        return np.zeros_like(keys[key])
    left, right = times[key] - times[key - 1], times[key + 1] - times[key]
    before, after = (keys[key] - keys[key - 1]) / left, (keys[key + 1] - keys[key]) / right
    onward = before * after > 0
    weights = (2 * right + left, right + 2 * left)
    below = weights[0] / np.where(onward, before, 1) + weights[1] / np.where(onward, after, 1)
    return np.where(onward, sum(weights) / np.where(onward, below, 1), 0)


def _hermite(start: NDArray, end: NDArray, speed: NDArray, end_speed: NDArray, t: float) -> NDArray:
    """The cubic from `start` to `end` for t from 0 to 1, with these slopes at its ends."""
    step = t * t * (3 - 2 * t)
    return start + step * (end - start) + t * (1 - t) * ((1 - t) * speed - t * end_speed)


def _shape(value: Any) -> Any:
    """The lengths of nested tuples; None for a number."""
    return [_shape(entry) for entry in value] if isinstance(value, tuple) else None


def _tuples(value: Any) -> Any:
    return tuple(_tuples(entry) for entry in value) if np.ndim(value) else float(value)
