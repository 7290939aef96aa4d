"""The sRGB transfer curve and the rounding to whole numbers (document, section 9).

Colors of scenes and pictures are display-referred sRGB, 0 to 1; "linear" means proportional to light. Both
curves come from colour-science and are applied to magnitudes, sign kept: f(-x) = -f(x), and values above 1
follow the same power law, because results are not clamped before output.
"""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable
from types import ModuleType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tracer.row_blocks import copy_pixels

# Values worked on at a time: a band in double precision stays in the cache, whatever the size of the picture.
BAND = 1 << 16


@functools.cache
def colour_science() -> ModuleType:
    """The colour-science package; importing it takes most of a second, so only who needs it pays.

    Its import warns about optional packages and changes how NumPy prints: neither may reach the user.
    """
    with warnings.catch_warnings(), np.printoptions():
        warnings.simplefilter("ignore")
        import colour
    return colour


def decode_srgb(display: ArrayLike) -> NDArray[np.floating]:
    """Linear values of display-referred ones (IEC 61966-2-1), any shape and range; NaN stays NaN.

    float32 stays float32, everything else becomes float64; the arithmetic is in double precision.
    """
    return _odd(colour_science().models.eotf_sRGB, display)


def encode_srgb(linear: ArrayLike) -> NDArray[np.floating]:
    """Display-referred values of linear ones (IEC 61966-2-1), the inverse of `decode_srgb`."""
    return _odd(colour_science().models.eotf_inverse_sRGB, linear)


def quantize(display: ArrayLike, bits: int = 8) -> NDArray[np.unsignedinteger]:
    """clamp(floor((2^bits - 1) I + 1/2)) as uint8 (bits = 8) or uint16 (bits = 16), any shape.

    Computed in double precision. NaN becomes 0: one broken pixel must not cost a whole render.
    """
    if bits not in (8, 16):
        raise ValueError(f"bits is {bits!r}; allowed: 8 or 16")
    top = 2**bits - 1
    source = np.asarray(display)
    result = np.empty(source.shape, np.uint8 if bits == 8 else np.uint16)
    values, whole = np.atleast_1d(source), np.atleast_1d(result)
    rows = max(1, BAND * len(values) // max(1, values.size))
    for start in range(0, len(values), rows):
        band = values[start : start + rows]
        part = np.empty(band.shape)
        copy_pixels(part, band)
        part *= top
        part += 0.5
        np.fmax(part, 0, out=part)  # unlike `maximum`, answers 0 for NaN
        np.fmin(part, top, out=part)
        whole[start : start + rows] = part  # the conversion drops the fraction: floor, as nothing is negative
    return result


def _odd(curve: Callable[[NDArray], NDArray], values: ArrayLike) -> NDArray[np.floating]:
    """The odd continuation of a curve that is given for x >= 0, evaluated band by band."""
    source = np.asarray(values)
    result = np.empty(source.shape, np.float32 if source.dtype == np.float32 else np.float64)
    flat, out = source.reshape(-1), result.reshape(-1)
    for start in range(0, flat.size, BAND):
        part = flat[start : start + BAND].astype(np.float64)
        out[start : start + BAND] = np.copysign(curve(np.abs(part)), part)
    return result
