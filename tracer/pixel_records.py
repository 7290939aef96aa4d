"""The numbers of a pixel side by side in memory: records of up to 64 bytes, each of which is written at once.

Lanes own pixels of tiles, so what they write lies scattered, and adjacent numbers take less time than one by
one: sixteen at once, a whole line of the cache, half of four times four. So vectors take single numbers
along: the coverage stands behind the color.
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

LINE = 64
"""Bytes that are written at once at most."""


def components_of(layers: Iterable[str], lights: int) -> dict[str, int]:
    """What a pass finds for each pixel, and how many numbers each of it has."""
    return PLAIN | {name: component_count(name, lights) for name in layers}


def records_of(counts: Mapping[str, int], mixed: bool) -> list[tuple[str, ...]]:
    """Which values share a record: the longest come first, then by name, each goes to the first record that
    has room.

    `counts`: how many numbers each value has; `mixed`: whether whole numbers may stand with real ones, which
    they do where both have 32 bits.
    """
    integers = {name: count for name, count in counts.items() if name in INTEGERS}
    reals = {name: count for name, count in counts.items() if name not in INTEGERS}
    return _packed(counts, True) if mixed else _packed(reals, False) + _packed(integers, False)


def line_of(mixed: bool) -> int:
    """Numbers that are written at once at most."""
    return LINE // (4 if mixed else 8)


def width_of(record: tuple[str, ...], counts: Mapping[str, int], mixed: bool) -> int:
    """Numbers of a record, those that fill it up included: a power of two, or whole lines."""
    numbers, line = sum(counts[name] for name in record), line_of(mixed)
    return 1 << (numbers - 1).bit_length() if numbers <= line else -(-numbers // line) * line


def _packed(counts: Mapping[str, int], mixed: bool) -> list[tuple[str, ...]]:
    rooms = _rooms(sum(counts.values()), line_of(mixed))
    records: list[tuple[str, ...]] = [()] * len(rooms)
    for name in sorted(counts, key=lambda name: (-counts[name], name)):
        if not any(room >= counts[name] for room in rooms):
            rooms.append(width_of((name,), counts, mixed))
            records.append(())
        place = next(place for place, room in enumerate(rooms) if room >= counts[name])
        records[place] = (*records[place], name)
        rooms[place] -= counts[name]
    return [record for record in records if record]


def _rooms(numbers: int, line: int) -> list[int]:
    """Widths of records for so many numbers: powers of two, which stay empty by one number at most."""
    rooms = []
    while numbers > 0:
        wanted = min(line, numbers + (numbers > 2))
        rooms.append(1 << (wanted.bit_length() - 1))
        numbers -= rooms[-1]
    return rooms


def scattered(
    backend: Backend, values: Mapping[str, list[Any]], index: Any, active: Any, pixels: int
) -> dict[str, Any]:
    """The values of lanes, each a list of components (n,), as flat arrays of records, by `key_of` them.

    `index` (n,): the place of a lane's pixel. Each pixel is written by the one lane that owns it: no atomics.
    """
    counts = {name: len(components) for name, components in values.items()}
    mixed = backend.precision == "single"
    line = line_of(mixed)
    arrays = {}
    for record in records_of(counts, mixed):
        reals = mixed or record[0] not in INTEGERS
        word, packet = (backend.Float, backend.FloatN) if reals else (backend.UInt32, backend.IdN)
        width = width_of(record, counts, mixed)
        numbers = [_as(word, component) for name in record for component in values[name]]
        numbers += [word(0)] * (width - len(numbers))
        arrays[key_of(record)] = target = dr.empty(word, pixels * width)
        for first in range(0, width, line):
            part = numbers[first : first + line]
            place = index * (width // len(part)) + first // line
            value = packet(*part) if len(part) > 1 else part[0]
            dr.scatter(target, value, place, active, mode=dr.ReduceMode.Permute)
    return arrays


def taken_apart(arrays: Mapping[str, NDArray], counts: Mapping[str, int], mixed: bool) -> dict[str, NDArray]:
    """The values (pixels, components) in arrays that `scattered` has written, by name; nothing is copied."""
    values = {}
    for record in records_of(counts, mixed):
        rows = arrays[key_of(record)].reshape(-1, width_of(record, counts, mixed))
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
