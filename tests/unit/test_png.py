"""PNG files read back by OpenCV and by a chunk parser of a few lines."""

from __future__ import annotations

import struct
import zlib

import cv2
import numpy as np
import pytest

from tracer.color import colour_science, quantize
from tracer.errors import OutputError
from tracer.film.png import encode_png, write_png

RNG = np.random.default_rng(3)


def chunks(data: bytes) -> list[tuple[bytes, bytes]]:
    """Kind and content of all chunks, checksums verified."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    found, at = [], 8
    while at < len(data):
        (length,) = struct.unpack_from(">I", data, at)
        body = data[at + 4 : at + 8 + length]
        assert struct.unpack_from(">I", data, at + 8 + length)[0] == zlib.crc32(body)
        found.append((body[:4], body[4:]))
        at += 12 + length
    return found


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("channels", [(), (3,), (4,)])
def test_values_come_back_exactly(tmp_path, bits, channels):
    image = RNG.random((37, 53, *channels)) * 1.2 - 0.1
    write_png(tmp_path / "a.png", image, bits)
    back = cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_UNCHANGED)
    if channels:
        back = back[..., [2, 1, 0, 3][: channels[0]]]
    assert back.dtype == (np.uint8 if bits == 8 else np.uint16)
    assert np.array_equal(back, quantize(image, bits))


@pytest.mark.parametrize(
    ("shape", "bits", "color_type"), [((2, 5), 8, 0), ((2, 5, 3), 16, 2), ((2, 5, 4), 8, 6)]
)
def test_color_chunks_stand_between_header_and_data(shape, bits, color_type):
    found = chunks(encode_png(np.zeros(shape), bits))
    kinds = [kind for kind, _ in found]
    assert kinds[0] == b"IHDR" and kinds[-1] == b"IEND"
    assert kinds[1:4] == [b"gAMA", b"cHRM", b"sRGB"] and kinds[4] == b"IDAT"
    assert struct.unpack(">IIBB", found[0][1][:10]) == (5, 2, bits, color_type)


def test_color_chunks_agree_with_colour_science():
    content = dict(chunks(encode_png(np.zeros((1, 1, 3)))))
    space = colour_science().RGB_COLOURSPACES["sRGB"]
    points = np.vstack((space.whitepoint, space.primaries)).ravel() * 100_000
    assert struct.unpack(">8I", content[b"cHRM"]) == tuple(np.round(points).astype(int))
    assert struct.unpack(">I", content[b"gAMA"]) == (round(100_000 / 2.2),)
    assert content[b"sRGB"] == b"\0"


def test_pixel_data_is_valid_zlib_of_the_right_length():
    found = chunks(encode_png(RNG.random((300, 200, 3)), 16))
    raw = zlib.decompress(b"".join(body for kind, body in found if kind == b"IDAT"))
    assert len(raw) == 300 * (1 + 200 * 3 * 2)


def test_same_picture_same_bytes(tmp_path):
    image = RNG.random((64, 64, 3))
    for name in ("a.png", "b.png"):
        write_png(tmp_path / name, image.copy())
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes() == encode_png(image)


def test_views_and_the_caller_s_array_are_respected():
    image = RNG.random((20, 30, 3)).astype(np.float32)
    kept = image.copy()
    assert encode_png(image[::2, ::-1]) == encode_png(image[::2, ::-1].copy())
    assert np.array_equal(image, kept)


@pytest.mark.parametrize("shape", [(4,), (4, 4, 2), (4, 4, 5), (0, 4, 3)])
def test_other_shapes_are_refused(shape):
    with pytest.raises(ValueError, match="image has shape .* allowed"):
        encode_png(np.zeros(shape))


def test_a_missing_folder_is_one_sentence(tmp_path):
    with pytest.raises(OutputError, match="a.png: cannot be written: No such file or directory"):
        write_png(tmp_path / "none" / "a.png", np.zeros((2, 2, 3)))
