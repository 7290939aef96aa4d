"""Reading pictures: PNG and JPEG, 1 to 4 channels, 8 or 16 bits (document, section 6).

Alpha, ICC profiles, gAMA and EXIF rotation are ignored: a texel is what the file's numbers say. The kind of
file is told by its first bytes, never by its name.
"""

from __future__ import annotations

import os
import struct
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from tracer.errors import SceneError
from tracer.native_output import captured_stderr

PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
JPEG_MAGIC = b"\xff\xd8\xff"
MAX_PIXELS = 2**28
AS_STORED = cv2.IMREAD_COLOR_RGB | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION


def read_picture(path: str | os.PathLike[str]) -> NDArray[np.float64]:
    """The picture as display-referred (h, w, 3) in [0, 1], row 0 at the top: stored value / (2^bits - 1).

    Gray becomes three equal channels. Raises SceneError with one sentence that names the file.
    """
    shown = os.fspath(path)
    data = _bytes_of(shown)
    size = _size(data, shown)
    if size is not None and size[0] * size[1] > MAX_PIXELS:
        raise SceneError(
            f"{shown}: the picture has {size[0]} x {size[1]} pixels; allowed: at most 2^28 = {MAX_PIXELS}"
        )
    return _unit_range(_decode(data, shown))


def _bytes_of(shown: str) -> bytes:
    path = Path(shown)
    try:
        if path.is_dir():
            raise SceneError(f"{shown}: is a folder; allowed: a PNG or JPEG file")
        if not path.exists():
            raise SceneError(f"{shown}: there is no such file")
        if not path.is_file():
            raise SceneError(f"{shown}: is not a regular file")
        return path.read_bytes()
    except SceneError:
        raise
    except OSError as error:
        raise SceneError(f"{shown}: cannot be read: {error.strerror}") from error


def _size(data: bytes, shown: str) -> tuple[int, int] | None:
    """Width and height as the header states them, before anything is unpacked; None where there are none."""
    if not data:
        raise SceneError(f"{shown}: the file is empty")
    if data.startswith(PNG_MAGIC):
        return struct.unpack_from(">II", data, 16) if len(data) >= 24 else None
    if data.startswith(JPEG_MAGIC):
        return _jpeg_size(data)
    raise SceneError(f"{shown}: is neither a PNG nor a JPEG picture")


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    """From the frame header, the first of the segments C0 to CF but C4, C8 and CC (ITU-T T.81, B.2.2)."""
    position = 2
    while position + 9 <= len(data) and data[position] == 0xFF:
        marker, length = data[position + 1], struct.unpack_from(">H", data, position + 2)[0]
        if marker == 0xFF:  # fill byte
            position += 1
        elif 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack_from(">HH", data, position + 5)
            return width, height
        else:
            position += 2 + length
    return None


def _decode(data: bytes, shown: str) -> NDArray[np.unsignedinteger]:
    """(h, w, 3) uint8 or uint16 in the order red, green, blue."""
    with captured_stderr() as said:
        try:
            pixels = cv2.imdecode(np.frombuffer(data, np.uint8), AS_STORED)
        except cv2.error:
            pixels = None
        remarks = said().splitlines()
    # libjpeg fills what is missing with gray and only says so; superfluous bytes do no harm.
    gaps = [line for line in remarks if "Corrupt JPEG data" in line and "extraneous bytes" not in line]
    if pixels is None or gaps:
        raise SceneError(f"{shown}: the picture is damaged or cut short")
    return pixels


def _unit_range(pixels: NDArray[np.unsignedinteger]) -> NDArray[np.float64]:
    result = np.empty(pixels.shape, np.float64)
    np.divide(pixels, np.iinfo(pixels.dtype).max, out=result)
    return result
