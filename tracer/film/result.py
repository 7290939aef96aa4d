"""The result of a render and the files it is saved to (document, sections 7 and 9).

A new file format is one function and one line in `WRITERS` (and its extension in `atomic.OUTPUT_SUFFIXES`).
"""

from __future__ import annotations

import json
import os
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracer.color import decode_srgb, encode_srgb
from tracer.errors import SceneError
from tracer.film.atomic import atomic_write, check_writable
from tracer.film.counts import header_of
from tracer.film.exr import HeaderValue, Window, read_exr, write_exr
from tracer.film.false_color import false_color, pictures_of
from tracer.film.layout import RGB, aov_channels, color_channels
from tracer.film.legend import with_legend
from tracer.film.png import encode_png, write_png
from tracer.textures.picture import read_picture


@dataclass(eq=False)
class Result:
    """What a render gives: arrays of h rows (top first) and w columns, and what is needed to name them."""

    color: NDArray[np.float32]  # (h, w, 3), display-referred, not clamped
    depth: NDArray[np.floating]  # (h, w), distance from the canvas along the ray, -1 blank [scene units]
    alpha: NDArray[np.floating]  # (h, w), share of the sub-rays that hit something, 0 to 1
    z: NDArray[np.floating] | None = None  # (h, w), distance from the eye along the view axis, +inf blank
    aovs: dict[str, NDArray] = field(default_factory=dict)  # (h, w) or (h, w, components) by name
    stats: dict[str, Any] = field(default_factory=dict)
    kernels: dict[str, int] = field(default_factory=dict)  # how many were compiled, read from disk, reused
    scene_name: str = ""
    hash_of: Callable[[], str] = str  # gives `scene_hash` when it is asked for
    version: str = ""
    backend: str = ""
    precision: str = ""
    seed: int = 0
    crop: Window | None = None  # (x0, y0, x1, y1) of these arrays in the full picture, end exclusive
    resolution: tuple[int, int] | None = None  # width, height of the full picture
    background: tuple[float, float, float] = (0.0, 0.0, 0.0)  # display-referred
    color_space: str = "display"  # in which sub-rays were averaged: "display" or "linear"

    @cached_property
    def scene_hash(self) -> str:
        """SHA-256 of the keys of the scene as it was rendered."""
        return self.hash_of()

    def save(
        self, path: str | os.PathLike[str], bits: int = 8, alpha: bool = False, half: bool = False
    ) -> None:
        """Writes .png, .exr or .npz, whole or not at all; raises OutputError.

        `bits` (8 or 16) and `alpha` (coverage as a fourth channel) are for PNG, `half` (16-bit color) for
        OpenEXR, which always has coverage.
        """
        check_writable(path)
        WRITERS[Path(path).suffix.lower()](self, path, SaveOptions(bits, alpha, half))

    def save_layers(self, path: str | os.PathLike[str]) -> list[Path]:
        """Writes each layer of `aovs` as a picture in false colors with a legend, `a.LAYER.png` for `a.png`
        and `a.exr` alike. Returns the files; raises OutputError."""
        files = []
        for name, values in pictures_of(self.aovs):
            image = false_color(name, values, self.color_space == "linear")
            files.append(layer_file(path, name))
            write_png(files[-1], with_legend(image, name, values))
        return files

    def metadata(self) -> dict[str, HeaderValue]:
        """What the files say about their origin, and counts; nothing that changes from run to run."""
        return {
            "sceneName": self.scene_name,
            "sceneHash": self.scene_hash,
            "tracerVersion": self.version,
            "backend": self.backend,
            "precision": self.precision,
            "seed": self.seed,
            **header_of(self.stats),
        }

    def _repr_png_(self) -> bytes:
        return encode_png(self.color)


def layer_file(path: str | os.PathLike[str], layer: str) -> Path:
    """The file of a layer's picture: `out/a.normal.png` beside `out/a.exr`."""
    return Path(path).with_suffix(f".{layer}.png")


@dataclass(frozen=True)
class SaveOptions:
    """How to write; each format takes what concerns it."""

    bits: int = 8
    alpha: bool = False
    half: bool = False


def _save_png(result: Result, path: str | os.PathLike[str], options: SaveOptions) -> None:
    write_png(path, _with_alpha(result) if options.alpha else result.color, options.bits)


def _save_exr(result: Result, path: str | os.PathLike[str], options: SaveOptions) -> None:
    height, width = result.depth.shape
    channels = color_channels(result.color, result.alpha) | {"depth": result.depth}
    if result.z is not None:
        channels["Z"] = result.z
    write_exr(
        path,
        channels | aov_channels(result.aovs),
        header=result.metadata(),
        data_window=result.crop,
        display_window=(0, 0, *(result.resolution or (width, height))),
        half_color=options.half,
    )


def _save_npz(result: Result, path: str | os.PathLike[str], options: SaveOptions) -> None:
    """Arrays under their own names, and `metadata`, a JSON text."""
    arrays: dict[str, Any] = dict(result.aovs)
    arrays |= {"color": result.color, "depth": result.depth, "alpha": result.alpha}
    if result.z is not None:
        arrays["z"] = result.z
    arrays["metadata"] = json.dumps(
        result.metadata() | {"crop": result.crop, "resolution": result.resolution}, sort_keys=True
    )
    with atomic_write(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **arrays)


WRITERS: dict[str, Callable[[Result, str | os.PathLike[str], SaveOptions], None]] = {
    ".png": _save_png,
    ".exr": _save_exr,
    ".npz": _save_npz,
}


def _with_alpha(result: Result) -> NDArray:
    """(h, w, 4): color without the share of the background, and coverage.

    PNG's alpha is not premultiplied: a viewer that puts the picture over the scene's background gets the
    opaque picture back. Where nothing was hit the color stays as it is.
    """
    linear = result.color_space == "linear"
    coverage = result.alpha.astype(np.float32, copy=False)
    color = np.concatenate((result.color, coverage[..., None]), axis=2, dtype=np.float32)
    partial = (coverage > 0) & (coverage < 1)
    share = coverage[partial, None]
    background = np.asarray(result.background)
    seen = color[partial, :3]
    if linear:
        seen, background = decode_srgb(seen), decode_srgb(background)
    object_color = (seen - (1 - share) * background) / share
    color[partial, :3] = encode_srgb(object_color) if linear else object_color
    return color


def load_picture_file(path: str | os.PathLike[str]) -> NDArray[np.floating]:
    """The display-referred colors (h, w, 3) of a .png, .jpg, .exr or .npz file. Raises SceneError."""
    suffix = Path(path).suffix.lower()
    if suffix == ".exr":
        channels, _ = read_exr(path)
        missing = [name for name in RGB if name not in channels]
        if missing:
            raise SceneError(f"{os.fspath(path)}: the file has no channel {missing[0]}")
        return encode_srgb(np.stack([channels[name] for name in RGB], axis=2, dtype=np.float32))
    return _read_npz(path) if suffix == ".npz" else read_picture(path)


def _read_npz(path: str | os.PathLike[str]) -> NDArray[np.floating]:
    shown = os.fspath(path)
    if not Path(path).is_file():
        raise SceneError(f"{shown}: there is no such file")
    if not zipfile.is_zipfile(path):
        raise SceneError(f"{shown}: is not a NumPy .npz file, or cut short")
    try:
        with np.load(path) as arrays:
            color = arrays["color"]
    except KeyError as error:
        raise SceneError(f"{shown}: the file has no array `color`") from error
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise SceneError(f"{shown}: the file is damaged") from error
    if not (color.dtype.kind == "f" and color.ndim == 3 and color.shape[2] == 3 and color.size):
        raise SceneError(f"{shown}: `color` is {color.dtype} {color.shape}; allowed: real numbers (h, w, 3)")
    return color
