"""Counter-based random numbers: the same for every tile size, thread count and backend.

Philox-4x32-10 of Salmon, Moraes, Dror, Shaw, Parallel Random Numbers: As Easy as 1, 2, 3, SC 2011. The key is
(seed, stream), the counter says what the number is for, so no state is kept and no order matters.
"""

from __future__ import annotations

from typing import Any

import drjit as dr

DEPTH_OF_FIELD_STREAM = 1
JITTER_STREAM = 2

_MULTIPLIERS = (0xD2511F53, 0xCD9E8D57)
_WEYL = (0x9E3779B9, 0xBB67AE85)
_ROUNDS = 10


def philox(key: tuple[Any, Any], counter: tuple[Any, Any, Any, Any]) -> tuple[Any, Any, Any, Any]:
    """Four random 32-bit words for a key of two and a counter of four 32-bit words."""
    k0, k1 = key
    c0, c1, c2, c3 = counter
    word = type(c0)
    m0, m1 = (word(m) for m in _MULTIPLIERS)
    for _ in range(_ROUNDS):
        high0, low0 = dr.mul_hi(m0, c0), m0 * c0
        high1, low1 = dr.mul_hi(m1, c2), m1 * c2
        c0, c1, c2, c3 = high1 ^ c1 ^ k0, low1, high0 ^ c3 ^ k1, low0
        k0, k1 = k0 + _WEYL[0], k1 + _WEYL[1]
    return c0, c1, c2, c3


def fraction(float_type: Any, word: Any) -> Any:
    """A number in [0, 1) from the upper 24 bits of a word: exact in single precision too."""
    return float_type(word >> 8) * 2.0**-24


def below(word: Any, count: Any) -> Any:
    """A whole number in 0 .. count - 1: floor(word count / 2^32)."""
    return dr.mul_hi(word, count)
