"""OpenEXR files read back by the official package itself, and by the bytes of their header."""

from __future__ import annotations

import numpy as np
import OpenEXR
import pytest

from tracer.errors import OutputError, SceneError
from tracer.film.exr import CHROMATICITIES, read_exr, write_exr

RNG = np.random.default_rng(4)


def some_channels(h: int = 40, w: int = 30) -> dict[str, np.ndarray]:
    ids = RNG.integers(-1, 5, (h, w))
    return {
        **{name: RNG.random((h, w)).astype(np.float32) for name in ("R", "G", "B", "A", "depth", "normal.X")},
        "Z": np.where(RNG.random((h, w)) < 0.5, np.inf, 3.0).astype(np.float32),
        "uv.U": np.full((h, w), np.nan, np.float32),
        "shape": ids,
    }


def test_channels_come_back_exactly_through_the_official_reader(tmp_path):
    path, channels = tmp_path / "a.exr", some_channels()
    write_exr(path, channels, header={})
    file = OpenEXR.File(str(path), separate_channels=True)
    assert len(file.parts) == 1
    back = {name: channel.pixels for name, channel in file.channels().items()}
    assert set(back) == set(channels)
    for name in channels.keys() - {"shape"}:
        assert back[name].dtype == np.float32
        assert np.array_equal(back[name], channels[name], equal_nan=True)
    assert back["shape"].dtype == np.uint32
    assert np.array_equal(back["shape"].view(np.int32), channels["shape"])


def test_read_exr_gives_the_same(tmp_path):
    channels = some_channels()
    write_exr(tmp_path / "a.exr", channels, header={"seed": 7, "backend": "llvm", "scale": 1.5})
    back, header = read_exr(tmp_path / "a.exr")
    assert np.array_equal(back["depth"], channels["depth"])
    assert (header["seed"], header["backend"], header["scale"]) == (7, "llvm", 1.5)
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION
    assert header["chromaticities"] == pytest.approx(CHROMATICITIES)
    assert header["dataWindow"] == header["displayWindow"] == (0, 0, 30, 40)


def test_strided_arrays_are_written_as_they_look(tmp_path):
    image = RNG.random((24, 18, 3)).astype(np.float32)
    write_exr(tmp_path / "a.exr", {"R": image[..., 1], "G": image[::-1, :, 2]}, header={})
    back, _ = read_exr(tmp_path / "a.exr")
    assert np.array_equal(back["R"], image[..., 1])
    assert np.array_equal(back["G"], image[::-1, :, 2])


def test_crop_is_a_data_window_inside_the_display_window(tmp_path):
    write_exr(
        tmp_path / "a.exr",
        some_channels(10, 20),
        header={},
        data_window=(5, 7, 25, 17),
        display_window=(0, 0, 64, 48),
    )
    box = OpenEXR.File(str(tmp_path / "a.exr")).header()
    assert [corner.tolist() for corner in box["dataWindow"]] == [[5, 7], [24, 16]]
    assert [corner.tolist() for corner in box["displayWindow"]] == [[0, 0], [63, 47]]


def test_half_is_for_color_only_and_stays_finite(tmp_path):
    channels = some_channels()
    channels["R"][0, 0] = 1e6
    write_exr(tmp_path / "a.exr", channels, header={}, half_color=True)
    back, _ = read_exr(tmp_path / "a.exr")
    assert {name for name in back if back[name].dtype == np.float16} == {"R", "G", "B", "A"}
    assert back["R"][0, 0] == 65504
    np.testing.assert_allclose(back["G"], channels["G"], rtol=2**-11, atol=2**-24)


def test_bytes_do_not_depend_on_the_run(tmp_path):
    channels = some_channels(100, 100)
    for name in ("a.exr", "b.exr"):
        write_exr(tmp_path / name, dict(channels), header={"sceneName": "x", "seed": 1})
    data = (tmp_path / "a.exr").read_bytes()
    assert data == (tmp_path / "b.exr").read_bytes()
    assert b"capDate" not in data


@pytest.mark.parametrize(("seed", "stored"), [(2**31 - 1, 2**31 - 1), (2**40, str(2**40)), (-5, -5)])
def test_large_whole_numbers_are_not_cut(tmp_path, seed, stored):
    write_exr(tmp_path / "a.exr", some_channels(), header={"seed": seed})
    assert read_exr(tmp_path / "a.exr")[1]["seed"] == stored


def test_the_caller_s_mappings_are_left_alone(tmp_path):
    channels, header = some_channels(), {"seed": 1}
    write_exr(tmp_path / "a.exr", channels, header=header)
    assert all(isinstance(array, np.ndarray) for array in channels.values())
    assert header == {"seed": 1}


def test_wrong_sizes_are_refused(tmp_path):
    with pytest.raises(ValueError, match="allowed: one"):
        write_exr(tmp_path / "a.exr", {"R": np.zeros((2, 2)), "G": np.zeros((2, 3))}, header={})
    with pytest.raises(ValueError, match="does not fit channels of 3 x 2 pixels"):
        write_exr(tmp_path / "a.exr", {"R": np.zeros((2, 3))}, header={}, data_window=(0, 0, 2, 3))
    with pytest.raises(OutputError, match="cannot be written"):
        write_exr(tmp_path / "none" / "a.exr", {"R": np.zeros((2, 3))}, header={})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("share", [0.02, 0.3, 0.6, 0.999])
def test_a_cut_file_is_one_sentence_and_no_noise(tmp_path, capfd, share):
    write_exr(tmp_path / "a.exr", some_channels(100, 100), header={})
    data = (tmp_path / "a.exr").read_bytes()
    (tmp_path / "b.exr").write_bytes(data[: int(len(data) * share)])
    with pytest.raises(SceneError, match="b.exr: the file is damaged or cut short$"):
        read_exr(tmp_path / "b.exr")
    assert tuple(capfd.readouterr()) == ("", "")


def test_overwritten_pixels_are_noticed(tmp_path, capfd):
    write_exr(tmp_path / "a.exr", some_channels(100, 100), header={})
    data = bytearray((tmp_path / "a.exr").read_bytes())
    middle = len(data) // 2
    data[middle : middle + 300] = bytes(300)
    (tmp_path / "a.exr").write_bytes(data)
    with pytest.raises(SceneError, match="damaged"):
        read_exr(tmp_path / "a.exr")
    assert tuple(capfd.readouterr()) == ("", "")


def test_other_files_are_refused(tmp_path):
    (tmp_path / "a.exr").write_text("no picture")
    with pytest.raises(SceneError, match="a.exr: is not an OpenEXR file"):
        read_exr(tmp_path / "a.exr")
    with pytest.raises(SceneError, match="b.exr: there is no such file"):
        read_exr(tmp_path / "b.exr")
