"""One record of a work file: a head of twenty bytes, a label (JSON), and arrays as they lie in memory.

The head, which is written last, has the lengths of what follows and a checksum of them, of the label and of
the record before; in the label are the checksums of the arrays. So a record counts only where it is whole and
follows the one that it was written behind: not one that was cut short by a crash, of which a power failure
has left a part, or that remained of an earlier use of the file.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import IO, Any

import numpy as np

from tracer.film.memory_blocks import Place, found_in, laid_out

_HEAD = struct.Struct("<QQI")  # bytes of the label, bytes of the arrays, CRC-32
_LONGEST_LABEL = 1 << 28
_PIECE = 1 << 16  # bytes

Label = dict[str, Any]


@dataclass(frozen=True)
class Record:
    """A whole record of a file: its label, where its arrays begin [byte], how they lie there, its end [byte],
    and its checksum."""

    label: Label
    begin: int
    places: Sequence[Place]
    blocks: Sequence[tuple[int, int]]  # bytes and checksum of each
    end: int
    checksum: int

    def arrays(self, file: IO[bytes]) -> dict[str, np.ndarray]:
        """Reads the arrays."""
        file.seek(self.begin)
        return found_in(self.places, [_read(file, size) for size, _ in self.blocks])


def write_record(
    file: IO[bytes],
    before: Record | int,
    label: Mapping[str, Any],
    arrays: Mapping[str, np.ndarray],
) -> Record:
    """Writes a record behind another one, or as the first one at a place [byte]; raises OSError."""
    place, chain = _after(before)
    places, parts = laid_out(arrays)
    blocks = [part.reshape(-1).view(np.uint8) for part in parts]
    sums = [(block.size, _checksum(block)) for block in blocks]
    text = json.dumps({"label": label, "arrays": places, "blocks": sums}).encode()
    file.seek(place + _HEAD.size)
    _write(file, text)
    for block in blocks:
        _write(file, block.data)
    file.seek(place)
    lengths = len(text), sum(block.size for block in blocks)
    checksum = _checksum_of_label(chain, *lengths, text)
    _write(file, _HEAD.pack(*lengths, checksum))
    return _record(text, place, checksum)


def record_after(file: IO[bytes], before: Record | int, size: int) -> Record | None:
    """The record behind another one, or the first one at a place [byte], of a file of so many bytes, if it is
    whole."""
    place, chain = _after(before)
    file.seek(place)
    head = file.read(_HEAD.size)
    if len(head) < _HEAD.size:
        return None
    text_length, array_length, checksum = _HEAD.unpack(head)
    end = place + _HEAD.size + text_length + array_length
    if text_length > _LONGEST_LABEL or end > size:
        return None
    text = file.read(text_length)
    if _checksum_of_label(chain, text_length, array_length, text) != checksum:
        return None
    record = _record(text, place, checksum)
    whole = all(_checksum(_read(file, length)) == found for length, found in record.blocks)
    return record if whole else None


def _after(before: Record | int) -> tuple[int, int]:
    """Place and beginning of the checksum of a record."""
    return (before, 0) if isinstance(before, int) else (before.end, before.checksum)


def _record(text: bytes, place: int, checksum: int) -> Record:
    content = json.loads(text)
    begin = place + _HEAD.size + len(text)
    end = begin + sum(size for size, _ in content["blocks"])
    return Record(content["label"], begin, content["arrays"], content["blocks"], end, checksum)


def _checksum(block: np.ndarray) -> int:
    """CRC-32 of the sums of 64 KiB each, as 64-bit words, and of the bytes that remain: eight times as fast
    as that of all bytes, and it sees what a medium does, which changes bytes or loses sectors."""
    summed = block.size // _PIECE * _PIECE
    sums = block[:summed].view(np.uint64).reshape(-1, _PIECE // 8).sum(axis=1)
    return zlib.crc32(block[summed:].data, zlib.crc32(sums.data))


def _checksum_of_label(chain: int, text_length: int, array_length: int, text: bytes) -> int:
    return zlib.crc32(text, zlib.crc32(_HEAD.pack(text_length, array_length, 0), chain))


def _read(file: IO[bytes], size: int) -> np.ndarray:
    block = np.empty(size, np.uint8)
    rest = block.data
    while rest:
        rest = rest[file.readinto(rest) :]  # type: ignore[attr-defined]
    return block


def _write(file: IO[bytes], part: bytes | memoryview) -> None:
    rest = memoryview(part)
    while rest:
        rest = rest[file.write(rest) :]
