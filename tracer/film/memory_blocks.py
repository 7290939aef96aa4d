"""Arrays as they lie in memory: those that share a block go into a file as that block, without being taken
apart.

A launch writes the numbers of a pixel side by side, and color, depth and layers are views of these records.
To copy each view out takes several times as long as to write what they share.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

Place = tuple[str, str, Sequence[int], int, int, Sequence[int]]
"""Name, dtype, shape, number of the block, offset and strides [bytes] of an array."""

COVERED = 0.7
"""Share of a block that its views must make up; otherwise each is copied."""


def laid_out(arrays: Mapping[str, np.ndarray]) -> tuple[list[Place], list[np.ndarray]]:
    """Where each array lies, ready for JSON, and the blocks, each one array without gaps."""
    used: dict[int, int] = {}
    for array in arrays.values():
        used[id(_owner(array))] = used.get(id(_owner(array)), 0) + array.nbytes
    places: list[Place] = []
    blocks: list[np.ndarray] = []
    numbers: dict[int, int] = {}
    for name, array in arrays.items():
        owner = _owner(array)
        if not (owner.flags.c_contiguous and used[id(owner)] >= COVERED * owner.nbytes):
            array = owner = np.ascontiguousarray(array)
        if id(owner) not in numbers:
            numbers[id(owner)] = len(blocks)
            blocks.append(owner)
        offset = array.ctypes.data - owner.ctypes.data
        places.append((name, array.dtype.str, array.shape, numbers[id(owner)], offset, array.strides))
    return places, blocks


def found_in(places: Iterable[Any], blocks: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
    """The arrays by name, as views of blocks of bytes."""
    return {
        name: np.ndarray(shape, dtype, blocks[number].data, offset, strides)
        for name, dtype, shape, number, offset, strides in places
    }


def _owner(array: np.ndarray) -> np.ndarray:
    """The array whose memory this one is a view of, or itself."""
    return array.base if isinstance(array.base, np.ndarray) else array
