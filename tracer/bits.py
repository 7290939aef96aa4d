"""Masks as the bits of a word."""

from __future__ import annotations

from typing import Any

import drjit as dr

from tracer.backends import Backend


def masks_in_word(backend: Backend, masks: list[Any]) -> Any:
    """Bit k of a word (n,) is mask k (n,); 32 masks at most."""
    word = backend.UInt32(0)
    for k, mask in enumerate(masks):
        word = dr.select(mask, word | (1 << k), word)
    return word
