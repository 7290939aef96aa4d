"""The header of a PLY file: byte order, and the elements with their properties."""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass, field

from tracer.shapes.words import short

_TYPES = {  # the old and the new names of the types of numbers, as `struct` and NumPy write them
    **dict(zip("char uchar short ushort int uint float double".split(), "bBhHiIfd", strict=True)),
    **dict(zip("int8 uint8 int16 uint16 int32 uint32 float32 float64".split(), "bBhHiIfd", strict=True)),
}
WIDTHS = {kind: struct.calcsize(f"={kind}") for kind in _TYPES.values()}
_MOST_DIGITS = 30  # of a count: enough for every lie that is worth repeating
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass
class Element:
    """One element of the header: its properties, name to (type, type of the list's length or None)."""

    name: str
    count: int
    properties: dict[str, tuple[str, str | None]] = field(default_factory=dict)


def read_header(data: bytes) -> tuple[str, list[Element], bytes]:
    """Byte order ("" for ascii), elements, and what follows the header."""
    start = re.match(rb"ply[ \t]*(\r\n|\n|\r)", data)
    newline = b"\r" if start and start[1] == b"\r" else b"\n"
    end = re.search(newline + rb"end_header[ \t\r]*?" + newline, data)
    if start is None or end is None:
        raise ValueError("it has no PLY header")
    form, elements = "missing", list[Element]()
    for number, line in enumerate(data[: end.start()].decode("ascii", errors="replace").splitlines(), 1):
        words = line.split()
        try:
            if words[:1] == ["format"]:
                form = words[1]
            elif words[:1] == ["element"]:
                elements.append(_element(words, elements))
            elif words[:1] == ["property"]:
                _add_property(words, elements[-1])
        except (ValueError, KeyError, IndexError):
            raise ValueError(f"line {number} of its header is `{short(line.strip())}`") from None
    if form not in _ORDERS:
        raise ValueError(f"its format is {short(form)}")
    return _ORDERS[form], elements, data[end.end() :]


def _element(words: list[str], others: list[Element]) -> Element:
    """`element NAME COUNT`; ValueError where that is wrong or said before."""
    _, name, count = words
    if len(count) > _MOST_DIGITS or int(count) < 0 or any(other.name == name for other in others):
        raise ValueError
    return Element(name, int(count))


def _add_property(words: list[str], element: Element) -> None:
    """`property TYPE NAME` or `property list TYPE TYPE NAME`; ValueError or KeyError where that is wrong."""
    *kinds, name = words[1:]
    if name in element.properties:
        raise ValueError
    if kinds[:1] == ["list"]:
        _, length, kind = kinds
        element.properties[name] = _TYPES[kind], _TYPES[length]
    else:
        (kind,) = kinds
        element.properties[name] = _TYPES[kind], None
