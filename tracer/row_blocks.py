"""Layers copied out of the records that they share.

Each layer is copied for itself, so the records of all the picture would come from memory once for each. Those
of a few rows stay in the processor's cache meanwhile.
"""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import NDArray

PIXELS = 1 << 14
"""Of a block of rows."""


def copy_together(pairs: Sequence[tuple[NDArray, NDArray]]) -> None:
    """Copies each second array, (h, w) or (h, w, components), into the first one; all have the same h and w.
    Numbers are cast as by `astype`."""
    if not pairs:
        return
    height, width = pairs[0][0].shape[:2]
    rows = max(1, PIXELS // max(1, width))
    for top in range(0, height, rows):
        block = slice(top, top + rows)
        for target, source in pairs:
            copy_pixels(target[block], source[block])


def copy_pixels(target: NDArray, source: NDArray) -> None:
    """Copies an array of any shape into another one; numbers are cast as by `astype`.

    Pixels that do not lie end to end share their records with other layers; NumPy copies their few components
    in less time one after the other.
    """
    if source.ndim < 3 or source.flags.c_contiguous:
        target[...] = source
        return
    for k in range(source.shape[-1]):
        target[..., k] = source[..., k]
