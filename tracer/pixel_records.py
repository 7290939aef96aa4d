"""The numbers of a pixel side by side in memory: records of up to four, which are written at once.

Lanes own pixels of tiles, so what they write lies scattered, and four adjacent numbers take less time than
one by one. So vectors take single numbers along: the coverage stands behind the color.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import drjit as dr
from numpy.typing import NDArray

from tracer.backends import Backend
from tracer.film.layout import INTEGERS, component_count

PLAIN = {"color": 3, "alpha": 1, "depth": 1, "z": 1}
"""What every picture has."""

LENGTH = 4
"""Numbers that are written at once. Longer values have records of several such parts."""


def components_of(layers: Iterable[str], lights: int) -> dict[str, int]:
    """What a pass finds for each pixel, and how many numbers each of it has."""
    return PLAIN | {name: component_count(name, lights) for name in layers}


def records_of(counts: Mapping[str, int], mixed: bool) -> list[tuple[str, ...]]:
    """Which values share a record: the longest come first, then by name, each goes to the first record that
    has room.

    `counts`: how many numbers each value has; `mixed`: whether whole numbers may stand with real ones, which
    they do where both have 32 bits.
    """
    records: list[tuple[str, ...]] = []
    for name in sorted(counts, key=lambda name: (-counts[name], name)):
        for place, record in enumerate(records):
            room = max(LENGTH, -(-counts[record[0]] // LENGTH) * LENGTH) - sum(
                counts[other] for other in record
            )
            if counts[name] <= room and (mixed or (name in INTEGERS) == (record[0] in INTEGERS)):
                records[place] = (*record, name)
                break
        else:
            records.append((name,))
    return records


def width_of(record: tuple[str, ...], counts: Mapping[str, int]) -> int:
    """Numbers of a record, those that fill it up included."""
    numbers = sum(counts[name] for name in record)
    return numbers if numbers <= 2 else -(-numbers // LENGTH) * LENGTH


def scattered(
    backend: Backend, values: Mapping[str, list[Any]], index: Any, active: Any, pixels: int
) -> dict[str, Any]:
    """The values of lanes, each a list of components (n,), as flat arrays of records, by `key_of` them.

    `index` (n,): the place of a lane's pixel. Each pixel is written by the one lane that owns it: no atomics.
    """
    counts = {name: len(components) for name, components in values.items()}
    arrays = {}
    for record in records_of(counts, backend.precision == "single"):
        reals = backend.precision == "single" or record[0] not in INTEGERS
        word, packet = (backend.Float, backend.FloatN) if reals else (backend.UInt32, backend.IdN)
        width = width_of(record, counts)
        numbers = [_as(word, component) for name in record for component in values[name]]
        numbers += [word(0)] * (width - len(numbers))
        arrays[key_of(record)] = target = dr.empty(word, pixels * width)
        for first in range(0, width, LENGTH):
            part = numbers[first : first + LENGTH]
            place = index * (width // len(part)) + first // LENGTH
            value = packet(*part) if len(part) > 1 else part[0]
            dr.scatter(target, value, place, active, mode=dr.ReduceMode.Permute)
    return arrays


def taken_apart(arrays: Mapping[str, NDArray], counts: Mapping[str, int], mixed: bool) -> dict[str, NDArray]:
    """The values (pixels, components) in arrays that `scattered` has written, by name; nothing is copied."""
    values = {}
    for record in records_of(counts, mixed):
        rows = arrays[key_of(record)].reshape(-1, width_of(record, counts))
        first = 0
        for name in record:
            part = rows[:, first : first + counts[name]]
            values[name] = part.view(INTEGERS[name]) if name in INTEGERS else part
            first += counts[name]
    return values


def key_of(record: tuple[str, ...]) -> str:
    """The name of an array of records."""
    return " and ".join(record)


def _as(word: Any, number: Any) -> Any:
    return number if type(number) is word else dr.reinterpret_array(word, number)
