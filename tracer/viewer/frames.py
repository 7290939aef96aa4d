"""A picture on its way to the page: eight bits, compressed, with what is to be known of it."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

DRAFT_QUALITY, STILL_QUALITY = 80, 93
"""Of JPEG: while something moves, and at rest."""


@dataclass(frozen=True)
class Frame:
    """A compressed picture. `number` counts frames; `revision`, `stamp`: of the view that it shows; `scale`
    against the full picture, `supersample` n for n x n rays a pixel, `final`: nothing better follows;
    `depth`: of the middle of the picture; `seconds`: what it took to render and to compress."""

    number: int
    revision: int
    stamp: float
    layer: str
    width: int
    height: int
    scale: float
    supersample: int
    final: bool
    depth: float
    seconds: dict[str, float]
    jpeg: bytes

    def message(self) -> bytes:
        """Length of the header (4 bytes, little-endian), the header as JSON, the picture."""
        header = json.dumps({key: value for key, value in asdict(self).items() if key != "jpeg"}).encode()
        return len(header).to_bytes(4, "little") + header + self.jpeg


def compressed(image: NDArray[np.uint8], quality: int) -> bytes:
    """The JPEG of an image (h, w, 3), red first."""
    data: Any = cv2.imencode(
        ".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, quality]
    )
    return bytes(data[1])
