"""Pictures of every kind, built byte by byte where no writer makes them, and broken in every way."""

from __future__ import annotations

import base64
import struct
import zlib

import cv2
import numpy as np
import pytest

from tracer.errors import SceneError
from tracer.textures.picture import read_picture

RNG = np.random.default_rng(7)


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(width: int, height: int, bits: int, color_type: int, rows: bytes, extra: bytes = b"") -> bytes:
    """A PNG from its unfiltered rows (each starts with a 0 byte)."""
    header = struct.pack(">IIBBBBB", width, height, bits, color_type, 0, 0, 0)
    body = chunk(b"IHDR", header) + extra + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


EXIF_ROTATED = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0"
PALETTE = chunk(b"PLTE", bytes([10, 20, 30, 40, 50, 60]))
PNGS = {
    "gray 8": (png(2, 1, 8, 0, bytes([0, 10, 20])), [[10] * 3, [20] * 3], 255),
    "gray 16": (png(2, 1, 16, 0, bytes([0, 1, 0, 2, 5])), [[256] * 3, [517] * 3], 65535),
    "gray 1": (png(3, 1, 1, 0, bytes([0, 0b10100000])), [[255] * 3, [0] * 3, [255] * 3], 255),
    "gray 4": (png(2, 1, 4, 0, bytes([0, 0x1F])), [[17] * 3, [255] * 3], 255),
    "gray alpha 8": (png(2, 1, 8, 4, bytes([0, 10, 0, 20, 128])), [[10] * 3, [20] * 3], 255),
    "gray alpha 16": (png(1, 1, 16, 4, bytes([0, 1, 2, 0, 9])), [[258] * 3], 65535),
    "rgb 8": (png(2, 1, 8, 2, bytes([0, 1, 2, 3, 4, 5, 6])), [[1, 2, 3], [4, 5, 6]], 255),
    "rgb 16": (png(1, 1, 16, 2, bytes([0, 1, 2, 3, 4, 5, 6])), [[258, 772, 1286]], 65535),
    "rgba 8": (png(2, 1, 8, 6, bytes([0, 1, 2, 3, 0, 4, 5, 6, 99])), [[1, 2, 3], [4, 5, 6]], 255),
    "rgba 16": (png(1, 1, 16, 6, bytes([0, 1, 2, 3, 4, 5, 6, 0, 0])), [[258, 772, 1286]], 65535),
    "palette": (png(2, 1, 8, 3, bytes([0, 1, 0]), PALETTE), [[40, 50, 60], [10, 20, 30]], 255),
    "palette with alpha": (
        png(2, 1, 8, 3, bytes([0, 1, 0]), PALETTE + chunk(b"tRNS", bytes([0, 128]))),
        [[40, 50, 60], [10, 20, 30]],
        255,
    ),
    "linear gamma": (
        png(1, 1, 8, 2, bytes([0, 1, 2, 3]), chunk(b"gAMA", struct.pack(">I", 100_000))),
        [[1, 2, 3]],
        255,
    ),
    "rotated": (
        png(2, 1, 8, 2, bytes([0, 1, 2, 3, 4, 5, 6]), chunk(b"eXIf", EXIF_ROTATED)),
        [[1, 2, 3], [4, 5, 6]],
        255,
    ),
}


def save(tmp_path, data: bytes, name: str = "a.png") -> str:
    (tmp_path / name).write_bytes(data)
    return str(tmp_path / name)


@pytest.mark.parametrize("kind", PNGS)
def test_every_kind_of_png(tmp_path, kind):
    data, row, top = PNGS[kind]
    picture = read_picture(save(tmp_path, data))
    assert picture.dtype == np.float64
    assert np.array_equal(picture, np.array([row]) / top)


def test_the_first_row_is_the_top(tmp_path):
    picture = read_picture(save(tmp_path, png(1, 2, 8, 0, bytes([0, 255, 0, 0]))))
    assert picture[:, 0, 0].tolist() == [1.0, 0.0]


def jpeg(channels: int = 3, *options: int) -> bytes:
    pixels = cv2.GaussianBlur(RNG.integers(0, 256, (40, 64, channels), dtype=np.uint8), (0, 0), 2)
    return cv2.imencode(".jpg", pixels, options)[1].tobytes()


@pytest.mark.parametrize("channels", [1, 3])
def test_jpeg_agrees_with_the_stored_numbers(tmp_path, channels):
    data = jpeg(channels)
    expected = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    picture = read_picture(save(tmp_path, data, "misnamed.png"))
    assert np.array_equal(picture, expected / 255)


# 8 x 8 pixels of cyan 64, magenta 128, yellow 32, black 40 (of 255), stored inverted as Adobe does.
CMYK_JPEG = base64.b64decode(
    "/9j/7gAOQWRvYmUAZAAAAAAA/9sAQwACAQEBAQECAQEBAgICAgIEAwICAgIFBAQDBAYFBgYGBQYGBgcJCAYHCQcGBggLCAkKCgoKCgYI"
    "CwwLCgwJCgoK/8AAFAgACAAIBEMRAE0RAFkRAEsRAP/EABYAAQEBAAAAAAAAAAAAAAAAAAkDCP/EABQQAQAAAAAAAAAAAAAAAAAAAAD/"
    "2gAOBEMATQBZAEsAAD8A34mXwrj/2Q=="
)


def test_jpeg_of_four_channels(tmp_path):
    ink = np.array([64, 128, 32]) / 255
    picture = read_picture(save(tmp_path, CMYK_JPEG))
    assert picture.shape == (8, 8, 3)
    np.testing.assert_allclose(
        picture, np.broadcast_to((1 - ink) * (1 - 40 / 255), (8, 8, 3)), atol=1.5 / 255
    )


def test_jpeg_rotation_is_ignored(tmp_path):
    data = jpeg()
    exif = b"Exif\0\0" + EXIF_ROTATED
    turned = data[:2] + b"\xff\xe1" + struct.pack(">H", 2 + len(exif)) + exif + data[2:]
    assert cv2.imdecode(np.frombuffer(turned, np.uint8), cv2.IMREAD_COLOR).shape == (64, 40, 3)
    assert np.array_equal(read_picture(save(tmp_path, turned)), read_picture(save(tmp_path, data)))


def test_superfluous_bytes_in_a_jpeg_do_no_harm(tmp_path, capfd):
    data = jpeg()
    padded = data[:-2] + bytes(4) + data[-2:]
    assert np.array_equal(read_picture(save(tmp_path, padded)), read_picture(save(tmp_path, data)))
    assert tuple(capfd.readouterr()) == ("", "")


def refused(path: str, message: str, capfd) -> None:
    with pytest.raises(SceneError, match=message):
        read_picture(path)
    assert tuple(capfd.readouterr()) == ("", "")


PLAIN_PNG = cv2.imencode(".png", RNG.integers(0, 256, (40, 60, 3), dtype=np.uint8))[1].tobytes()
PLAIN_JPEG = jpeg()
PROGRESSIVE = jpeg(3, cv2.IMWRITE_JPEG_PROGRESSIVE, 1)


@pytest.mark.parametrize("data", [PLAIN_PNG, PLAIN_JPEG, PROGRESSIVE], ids=["png", "jpeg", "progressive"])
@pytest.mark.parametrize("kept", [0.01, 0.05, 0.2, 0.5, 0.9, 0.995])
def test_a_cut_picture_is_one_sentence_and_no_noise(tmp_path, capfd, data, kept):
    path = save(tmp_path, data[: max(9, int(len(data) * kept))], "cut.png")
    refused(path, "cut.png: the picture is damaged or cut short$", capfd)


BROKEN = {
    "checksum of the data": PLAIN_PNG[:300] + b"xx" + PLAIN_PNG[302:],
    "too few rows": png(2, 2, 8, 2, bytes([0, 1, 2, 3, 4, 5, 6])),
    "no zlib stream": png(1, 1, 8, 2, b"").replace(zlib.compress(b""), b"garbage!"),
    "no pixels": png(0, 1, 8, 2, b"\0"),
    "unknown color type": png(1, 1, 8, 5, b"\0\0"),
    "jpeg that ends early": PLAIN_JPEG[:700] + b"\xff\xd9",
    "jpeg without a frame": b"\xff\xd8\xff\xd9",
    "jpeg of noise": b"\xff\xd8\xff" + bytes(range(256)),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_damage_is_one_sentence_and_no_noise(tmp_path, capfd, kind):
    refused(save(tmp_path, BROKEN[kind]), "a.png: the picture is damaged or cut short$", capfd)


def test_what_is_no_picture(tmp_path, capfd):
    (tmp_path / "folder.png").mkdir()
    refused(str(tmp_path / "folder.png"), "folder.png: is a folder; allowed: a PNG or JPEG file$", capfd)
    refused(str(tmp_path / "none.png"), "none.png: there is no such file$", capfd)
    refused(save(tmp_path, b""), "a.png: the file is empty$", capfd)
    neither = "a.png: is neither a PNG nor a JPEG picture$"
    bmp = cv2.imencode(".bmp", np.zeros((4, 4, 3), np.uint8))[1].tobytes()
    for data in (bmp, b"some text", PLAIN_PNG[:5]):
        refused(save(tmp_path, data), neither, capfd)


def jpeg_of_size(width: int, height: int) -> bytes:
    """The plain JPEG with other numbers in its frame header."""
    at = PLAIN_JPEG.index(b"\xff\xc0") + 5
    return PLAIN_JPEG[:at] + struct.pack(">HH", height, width) + PLAIN_JPEG[at + 4 :]


@pytest.mark.parametrize("build", [lambda w, h: png(w, h, 8, 2, b"\0"), jpeg_of_size], ids=["png", "jpeg"])
def test_too_many_pixels_are_refused_before_unpacking(tmp_path, capfd, build):
    message = "a.png: the picture has 65000 x 60000 pixels; allowed: at most 2\\^28 = 268435456$"
    refused(save(tmp_path, build(65000, 60000)), message, capfd)
