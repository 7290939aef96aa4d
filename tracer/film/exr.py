"""OpenEXR files: one part, ZIP, float32 or uint32 channels, nothing that changes from run to run.

Windows are (x0, y0, x1, y1) in pixels, end exclusive, as everywhere in this package; the file's own are
inclusive. Written and read by the official OpenEXR package.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from tracer.errors import OutputError, SceneError
from tracer.film.atomic import atomic_write
from tracer.native_output import captured_stderr
from tracer.row_blocks import copy_together

Window: TypeAlias = tuple[int, int, int, int]
HeaderValue: TypeAlias = str | int | float

# Red, green, blue, white (x, y): ITU-R BT.709, the primaries of sRGB, and D65.
CHROMATICITIES = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
COLOR_CHANNELS = frozenset("RGBA")
HALF_MAX = float(np.finfo(np.float16).max)


def write_exr(
    path: str | os.PathLike[str],
    channels: Mapping[str, NDArray],
    *,
    header: Mapping[str, HeaderValue],
    data_window: Window | None = None,
    display_window: Window | None = None,
    half_color: bool = False,
) -> None:
    """Writes channels (h, w): whole numbers as uint32 (-1 becomes 4294967295), all others as float32.

    `half_color` stores R, G, B and A as float16, limited to its range. `data_window` is the place of the
    channels inside `display_window` (default: both start at the origin). A whole number of the header that
    does not fit in 32 bits becomes text. Raises OutputError.
    """
    shapes = {array.shape for array in channels.values()}
    if len(shapes) != 1:
        raise ValueError(f"channels have the shapes {sorted(shapes)}; allowed: one (h, w) for all")
    height, width = shapes.pop()
    window = data_window or (0, 0, width, height)
    if (window[2] - window[0], window[3] - window[1]) != (width, height):
        raise ValueError(f"data window {window} does not fit channels of {width} x {height} pixels")
    attributes = {key: _attribute(value) for key, value in sorted(header.items())} | {
        "type": OpenEXR.scanlineimage,
        "compression": OpenEXR.ZIP_COMPRESSION,
        "chromaticities": CHROMATICITIES,
        "dataWindow": _inclusive(window),
        "displayWindow": _inclusive(display_window or window),
    }
    pixels = _contiguous(channels, half_color)
    _use_all_cores()
    with atomic_write(path) as temporary:
        try:
            OpenEXR.File(attributes, pixels).write(str(temporary))
        except RuntimeError as error:
            reason = str(error).rpartition('". ')[2].rstrip(".")  # without the temporary file's name
            raise OutputError(f"{os.fspath(path)}: cannot be written: {reason}") from error


def read_exr(path: str | os.PathLike[str]) -> tuple[dict[str, NDArray], dict[str, Any]]:
    """The channels (h, w) by name and the header of the first part; windows end-exclusive. SceneError."""
    shown = os.fspath(path)
    if not Path(shown).is_file():
        raise SceneError(f"{shown}: there is no such file")
    with captured_stderr(), redirect_stdout(StringIO()):  # the package prints what it finds wrong
        if not OpenEXR.isOpenExrFile(shown):
            raise SceneError(f"{shown}: is not an OpenEXR file")
        try:
            file = OpenEXR.File(shown, separate_channels=True)
            header = dict(file.header())
            channels = {name: channel.pixels for name, channel in file.channels().items()}
        except (RuntimeError, ValueError) as error:
            raise SceneError(f"{shown}: the file is damaged or cut short") from error
    for key in ("dataWindow", "displayWindow"):
        header[key] = _exclusive(header[key])
    return channels, header


def _contiguous(channels: Mapping[str, NDArray], half_color: bool) -> dict[str, NDArray]:
    """The channels in the file's types, without gaps, copied where they are not so already; the package reads
    strided arrays wrongly."""
    found: dict[str, NDArray] = {}
    copies = []
    for name, array in channels.items():
        kind: Any = np.uint32 if np.issubdtype(array.dtype, np.integer) else np.float32
        if half_color and name in COLOR_CHANNELS:
            array, kind = np.clip(array, -HALF_MAX, HALF_MAX), np.float16
        found[name] = array
        if array.dtype != kind or not array.flags.c_contiguous:
            found[name] = np.empty(array.shape, kind)
            copies.append((found[name], array))
    copy_together(copies)
    return found


def _attribute(value: HeaderValue) -> HeaderValue:
    if isinstance(value, int) and not -(2**31) <= value < 2**31:
        return str(value)
    return value


def _inclusive(window: Window) -> tuple[tuple[int, int], tuple[int, int]]:
    x0, y0, x1, y1 = window
    return (x0, y0), (x1 - 1, y1 - 1)


def _exclusive(box: tuple[NDArray, NDArray]) -> Window:
    (x0, y0), (x1, y1) = box
    return int(x0), int(y0), int(x1) + 1, int(y1) + 1


def _use_all_cores() -> None:
    """Compression in parallel; the package starts without worker threads. The bytes do not depend on it."""
    if OpenEXR.global_thread_count() == 0:
        OpenEXR.set_global_thread_count(os.cpu_count() or 1)
