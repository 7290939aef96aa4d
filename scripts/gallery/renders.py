"""Full-size renders, kept from one run to the next while neither scene nor renderer changed."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import tracer
from scripts.gallery.entries import Entry
from tracer.assets import PACKAGE
from tracer.film.exr import read_exr


@dataclass(frozen=True, eq=False)
class Render:
    """A scene's picture and depth buffer at full size."""

    picture: NDArray[np.uint8]  # (h, w, 3), blue, green, red, as OpenCV has it
    depth: NDArray[np.float32]  # (h, w), distance from the canvas along the ray, -1 blank [scene units]


def rendered(entry: Entry, folder: Path) -> tuple[Render, bool]:
    """The scene's render from `folder`, and whether it had to be made anew. Raises TracerError.

    Both cases read the files, so that a kept render and a new one give the same bytes. Always in single
    precision on the processor: pages made on a machine with a GPU are to be those of one without.
    """
    picture, layers, mark = (folder / f"{entry.name}{suffix}" for suffix in (".png", ".exr", ".made-from"))
    made_from = f"{entry.fingerprint} {renderer_hash()}\n"
    files = (picture, layers, mark)
    fresh = not all(file.is_file() for file in files) or mark.read_text(encoding="utf-8") != made_from
    if fresh:
        mark.unlink(missing_ok=True)
        result = tracer.render(tracer.load(entry.path), precision="single", backend="llvm")
        result.save(picture)
        result.save(layers)
        mark.write_text(made_from, encoding="utf-8")
    channels, _ = read_exr(layers)
    pixels = cv2.imread(str(picture), cv2.IMREAD_COLOR)
    return Render(np.asarray(pixels, np.uint8), channels["depth"]), fresh


@cache
def renderer_hash() -> str:
    """SHA-256 of the renderer's source: a render of yesterday's code is no render of today's."""
    digest = hashlib.sha256()
    for file in sorted(PACKAGE.rglob("*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest()
