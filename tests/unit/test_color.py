"""The transfer curve against the standard's formula in plain Python, and rounding against exact fractions."""

from __future__ import annotations

import math
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest

from tracer.color import BAND, decode_srgb, encode_srgb, quantize


def ref_decode(v: float) -> float:
    """IEC 61966-2-1, formula for one value."""
    size = abs(v)
    return math.copysign(size / 12.92 if size <= 0.04045 else ((size + 0.055) / 1.055) ** 2.4, v)


@pytest.mark.parametrize("value", [0.0, 0.01, 0.0404, 0.05, 0.5, 1.0, 1.7, 40.0, -0.01, -0.5, -3.0])
def test_decode_follows_the_standard_with_the_sign_kept(value):
    assert decode_srgb(value) == pytest.approx(ref_decode(value), rel=1e-12)


def test_encode_inverts_decode():
    values = np.linspace(-2, 3, 5001)
    np.testing.assert_allclose(encode_srgb(decode_srgb(values)), values, rtol=0, atol=1e-7)


def test_every_8_bit_value_survives_a_float32_round_trip():
    values = np.arange(256, dtype=np.float32) / 255
    assert np.array_equal(quantize(encode_srgb(decode_srgb(values))), np.arange(256))


@pytest.mark.parametrize("curve", [decode_srgb, encode_srgb])
def test_type_and_shape_are_kept_across_bands(curve):
    values = np.random.default_rng(1).random((3, BAND // 2, 1))
    assert curve(values.astype(np.float32)).dtype == np.float32
    assert curve(values).dtype == np.float64
    assert curve(values).shape == values.shape
    assert curve(values)[2, -1, 0] == curve(values[2, -1, 0])
    assert np.array_equal(curve(values[:, ::-3]), curve(values)[:, ::-3])


def test_nan_and_infinity_pass_through():
    assert np.isnan(decode_srgb([np.nan])).all()
    assert decode_srgb([np.inf, -np.inf]).tolist() == [np.inf, -np.inf]


@pytest.mark.parametrize("bits", [8, 16])
def test_quantize_is_the_floor_of_the_document(bits):
    top = 2**bits - 1
    values = np.random.default_rng(2).random(2 * BAND + 7).astype(np.float32)
    values[:4] = [0, 1, 0.5, 0.25]
    picks = list(range(200)) + [BAND - 1, BAND, 2 * BAND + 6]
    expected = [math.floor(top * Fraction(float(values[k])) + Fraction(1, 2)) for k in picks]
    assert quantize(values, bits)[picks].tolist() == expected


def test_quantize_clamps_and_makes_nan_black():
    values = [-0.2, -np.inf, 1.5, np.inf, np.nan, 1e30]
    assert quantize(values).tolist() == [0, 0, 255, 255, 0, 255]
    assert quantize(values, 16).dtype == np.uint16


def test_quantize_refuses_other_depths():
    with pytest.raises(ValueError, match="bits is 10; allowed: 8 or 16"):
        quantize([0.5], 10)


def test_colour_science_is_loaded_late_and_leaves_numpy_and_stderr_alone():
    code = (
        "import sys, numpy as np, tracer.color as c\n"
        "assert 'colour' not in sys.modules\n"
        "before = np.get_printoptions()\n"
        "c.decode_srgb([0.5])\n"
        "assert 'colour' in sys.modules and np.get_printoptions() == before\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
