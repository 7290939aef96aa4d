"""Pictures for the pages: small scenes at their own size, larger ones 640 pixels wide, and full size."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

WIDEST = 640  # pixels
LOSSLESS = 101  # what OpenCV takes for it
QUALITY = 90
LARGEST_LOSSLESS = 24_000
"""Bytes: smooth shading and flat colors stay exact; what is larger is full of texture, where losses hide."""


def thumbnail_size(image: NDArray) -> tuple[int, int]:
    """Width and height [pixels] of the thumbnail of a picture (h, w, ...)."""
    height, width = image.shape[:2]
    return (width, height) if width <= WIDEST else (WIDEST, round(height * WIDEST / width))


def thumbnail(image: NDArray[np.uint8]) -> bytes:
    """A picture (h, w, 3), blue first, as a WebP file. The same picture gives the same bytes."""
    size = thumbnail_size(image)
    if size != image.shape[1::-1]:
        image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
    exact = _webp(image, LOSSLESS)
    return exact if len(exact) <= LARGEST_LOSSLESS else _webp(image, QUALITY)


def full_size(image: NDArray[np.uint8]) -> bytes:
    """The same at the picture's own size."""
    return _webp(image, QUALITY)


def _webp(image: NDArray[np.uint8], quality: int) -> bytes:
    return cv2.imencode(".webp", image, [cv2.IMWRITE_WEBP_QUALITY, quality])[1].tobytes()
