"""Differences with known answers: by hand, and CIEDE2000 from its definition's own test data."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tracer.color import colour_science
from tracer.compare import compare_pictures, write_difference
from tracer.errors import OutputError, UsageError


def gray(value: float, h: int = 20, w: int = 30) -> np.ndarray:
    return np.full((h, w, 3), value)


def test_equal_pictures():
    found = compare_pictures(gray(0.3), gray(0.3))
    assert (found.maximum, found.rms, found.delta_e_mean, found.delta_e_max) == (0, 0, 0, 0)
    assert (found.differing, found.pixels, found.position) == (0, 600, None)


def test_one_pixel():
    a, b = gray(0.5), gray(0.5)
    b[7, 11, 1] += 0.25
    b[9, 3, 2] -= 0.125
    found = compare_pictures(a, b)
    assert found.maximum == 0.25
    assert found.position == (11, 7)
    assert found.differing == 2
    assert found.rms == pytest.approx(np.sqrt((0.25**2 + 0.125**2) / 1800))
    assert compare_pictures(a, b, tolerance=0.2).differing == 1


def test_many_bands_give_what_one_formula_gives():
    rng = np.random.default_rng(8)
    a, b = rng.random((300, 200, 3)), rng.random((300, 200, 3)).astype(np.float32)
    found, apart = compare_pictures(a, b), np.abs(a - b)
    assert found.maximum == apart.max()
    assert found.rms == pytest.approx(np.sqrt(np.mean(apart**2)), rel=1e-12)
    row, column = np.argwhere(apart == apart.max())[0][:2]
    assert found.position == (column, row)


def test_delta_e_of_black_and_white_is_100():
    """L* differs by 100 and the lightness weight at the mean L* = 50 is 1."""
    assert compare_pictures(gray(0.0), gray(1.0)).delta_e_max == pytest.approx(100, abs=1e-3)


def test_delta_e_is_that_of_the_published_pairs():
    """The first pair of Sharma, Wu and Dalal (2005), brought to sRGB and back: 2.0425."""
    colour = colour_science()
    lab = np.array([[50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485]])
    assert colour.difference.delta_E_CIE2000(lab[0], lab[1]) == pytest.approx(2.0425, abs=1e-4)
    inside = np.array([[50.0, 10.0, -20.0], [51.0, 12.0, -18.0]])
    rgb = colour.XYZ_to_sRGB(colour.Lab_to_XYZ(inside))
    assert ((rgb > 0) & (rgb < 1)).all()
    a, b = (np.broadcast_to(color, (4, 5, 3)) for color in rgb)
    found = compare_pictures(a, b)
    expected = colour.difference.delta_E_CIE2000(inside[0], inside[1])
    assert found.delta_e_mean == pytest.approx(expected, abs=1e-3)
    assert found.delta_e_max == pytest.approx(expected, abs=1e-3)


def test_delta_e_sees_what_the_screen_shows():
    found = compare_pictures(gray(1.0), gray(7.0))
    assert found.maximum == 6 and found.delta_e_max == 0


def test_broken_values_count_unless_both_are_broken():
    a, b = gray(0.5), gray(0.5)
    a[0, 0], b[0, 0] = np.nan, np.nan
    a[1, 1], b[1, 1] = np.inf, np.inf
    assert compare_pictures(a, b).maximum == 0
    b[3, 2, 0] = np.nan
    found = compare_pictures(a, b)
    assert found.maximum == np.inf and found.position == (2, 3) and found.differing == 1


def test_other_sizes_are_refused(tmp_path):
    message = "different sizes: 30 x 20 and 30 x 21 pixels"
    with pytest.raises(UsageError, match=message):
        compare_pictures(gray(0), gray(0, h=21))
    with pytest.raises(UsageError, match=message):
        write_difference(tmp_path / "d.png", gray(0), gray(0, h=21))


@pytest.mark.parametrize(("gain", "expected"), [(None, 255), (1.0, 51), (2.0, 102)])
def test_difference_picture(tmp_path, gain, expected):
    b = gray(0.5)
    b[4, 6, 0] += 0.2
    write_difference(tmp_path / "d.png", gray(0.5), b, gain)
    shown = cv2.imread(str(tmp_path / "d.png"), cv2.IMREAD_COLOR_RGB)
    assert shown[4, 6].tolist() == [expected, 0, 0]
    assert np.count_nonzero(shown) == 1


def test_difference_picture_of_equal_pictures_is_black(tmp_path):
    write_difference(tmp_path / "d.png", gray(0.5), gray(0.5))
    assert not cv2.imread(str(tmp_path / "d.png")).any()


def test_difference_picture_is_a_png(tmp_path):
    with pytest.raises(OutputError, match='d.jpg: the extension ".jpg" is unknown; allowed: .png$'):
        write_difference(tmp_path / "d.jpg", gray(0), gray(0))
