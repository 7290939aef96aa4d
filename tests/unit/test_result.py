"""A result's three files against each other and against independent readers."""

from __future__ import annotations

import json

import cv2
import numpy as np
import OpenEXR
import pytest

from tracer.color import encode_srgb, quantize
from tracer.errors import OutputError, SceneError
from tracer.film.result import Result, load_picture_file

H, W = 24, 36


@pytest.fixture
def result() -> Result:
    rng = np.random.default_rng(5)
    color = (rng.random((H, W, 3)) * 1.3 - 0.1).astype(np.float32)
    alpha = rng.integers(0, 5, (H, W)).astype(np.float32) / 4
    depth = np.where(alpha > 0, 10 * rng.random((H, W)), -1).astype(np.float32)
    return Result(
        color=color,
        depth=depth,
        alpha=alpha,
        z=np.where(alpha > 0, depth + 800, np.inf).astype(np.float32),
        aovs={
            "normal": rng.random((H, W, 3)),
            "Ng": rng.random((H, W, 3)).astype(np.float32),
            "position": rng.random((H, W, 3)).astype(np.float32),
            "shape": rng.integers(-1, 4, (H, W), dtype=np.int32),
            "primitive": rng.integers(0, 9, (H, W), dtype=np.uint32),
            "uv": np.full((H, W, 2), np.nan, np.float32),
            "visibility": rng.random((H, W, 2)).astype(np.float32),
            "level": rng.integers(0, 9, (H, W)),
            "rays": rng.integers(0, 99, (H, W)),
            **{
                part: rng.random((H, W, 3)).astype(np.float32)
                for part in ("ambient", "diffuse", "specular", "reflected", "refracted")
            },
        },
        stats={"seconds": 1.25},
        scene_name="room",
        hash_of=lambda: "abc",
        version="0.1",
        backend="llvm",
        precision="single",
        seed=3,
    )


def read(path) -> tuple[dict[str, np.ndarray], dict]:
    file = OpenEXR.File(str(path), separate_channels=True)
    return {name: channel.pixels for name, channel in file.channels().items()}, file.header()


def test_pictures_of_layers(result, tmp_path):
    files = result.save_layers(tmp_path / "a.exr")
    layers = [*result.aovs]
    layers[layers.index("visibility")] = "visibility.light0"
    layers.insert(layers.index("visibility.light0") + 1, "visibility.light1")
    assert files == [tmp_path / f"a.{layer}.png" for layer in layers]
    assert cv2.imread(str(files[-1]))[..., ::-1].tobytes() == quantize(result.aovs["refracted"]).tobytes()
    result.color_space = "linear"
    (encoded,) = (file for file in result.save_layers(tmp_path / "b.png") if "diffuse" in file.name)
    assert np.array_equal(
        cv2.imread(str(encoded))[..., ::-1], quantize(encode_srgb(result.aovs["diffuse"]))
    ), "as the picture, not linear"


def test_exr_layout(result, tmp_path):
    result.save(tmp_path / "a.exr")
    channels, header = read(tmp_path / "a.exr")
    rgb = {
        f"{part}.{c}" for part in ("ambient", "diffuse", "specular", "reflected", "refracted") for c in "RGB"
    }
    xyz = {f"{part}.{c}" for part in ("normal", "Ng", "position") for c in "XYZ"}
    single = {*"RGBAZ", "depth", "shape", "primitive", "level", "rays"}
    assert set(channels) == single | rgb | xyz | {"uv.U", "uv.V", "visibility.light0", "visibility.light1"}
    whole = {name for name, pixels in channels.items() if pixels.dtype == np.uint32}
    assert whole == {"shape", "primitive"}
    assert all(channels[name].dtype == np.float32 for name in channels.keys() - whole)
    assert header["sceneName"] == "room" and header["sceneHash"] == "abc" and header["tracerVersion"] == "0.1"
    assert header["backend"] == "llvm" and header["precision"] == "single" and header["seed"] == 3
    assert not any("1.25" in str(value) for value in header.values())


def test_exr_values(result, tmp_path):
    result.save(tmp_path / "a.exr")
    channels, _ = read(tmp_path / "a.exr")
    blank = result.alpha == 0
    assert np.array_equal(channels["A"], result.alpha)
    assert (channels["depth"][blank] == -1).all() and np.isinf(channels["Z"][blank]).all()
    assert (channels["shape"][result.aovs["shape"] == -1] == 4294967295).all()
    assert np.array_equal(channels["normal.Y"], result.aovs["normal"][..., 1].astype(np.float32))
    assert np.array_equal(channels["reflected.B"], result.aovs["reflected"][..., 2])
    assert np.array_equal(channels["visibility.light1"], result.aovs["visibility"][..., 1])
    assert np.array_equal(channels["level"], result.aovs["level"])


@pytest.mark.parametrize("bits", [8, 16])
def test_both_files_look_the_same(result, tmp_path, bits):
    result.save(tmp_path / "a.png", bits=bits)
    result.save(tmp_path / "a.exr")
    png = cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_UNCHANGED)[..., ::-1].astype(int)
    channels, _ = read(tmp_path / "a.exr")
    shown = encode_srgb(np.stack([channels[c] for c in "RGB"], axis=2))
    assert np.abs(png - quantize(shown, bits).astype(int)).max() <= (0 if bits == 8 else 1)
    assert np.array_equal(png, quantize(result.color, bits))


def test_half_color(result, tmp_path):
    result.save(tmp_path / "a.exr", half=True)
    channels, _ = read(tmp_path / "a.exr")
    assert {name for name in channels if channels[name].dtype == np.float16} == set("RGBA")


def test_crop(result, tmp_path):
    result.crop, result.resolution = (4, 8, 4 + W, 8 + H), (100, 80)
    result.save(tmp_path / "a.exr")
    _, header = read(tmp_path / "a.exr")
    assert [corner.tolist() for corner in header["dataWindow"]] == [[4, 8], [3 + W, 7 + H]]
    assert [corner.tolist() for corner in header["displayWindow"]] == [[0, 0], [99, 79]]


def test_without_z_there_is_no_z_channel(result, tmp_path):
    result.z = None
    result.save(tmp_path / "a.exr")
    assert "Z" not in read(tmp_path / "a.exr")[0]


@pytest.mark.parametrize("color_space", ["display", "linear"])
def test_alpha_over_the_background_gives_the_opaque_picture(result, tmp_path, color_space):
    from tracer.color import decode_srgb

    background = np.array([0.2, 0.4, 0.6])
    rng = np.random.default_rng(6)
    surface, share = rng.random((H, W, 3)), result.alpha[..., None]
    if color_space == "display":
        result.color = (share * surface + (1 - share) * background).astype(np.float32)
    else:
        mixed = share * decode_srgb(surface) + (1 - share) * decode_srgb(background)
        result.color = encode_srgb(mixed).astype(np.float32)
    result.background, result.color_space = tuple(background), color_space
    result.save(tmp_path / "a.png", bits=16, alpha=True)
    png = cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_UNCHANGED)
    rgb, alpha = png[..., 2::-1] / 65535, png[..., 3] / 65535
    np.testing.assert_allclose(alpha, result.alpha, atol=1e-5)
    hit = result.alpha > 0
    np.testing.assert_allclose(rgb[hit], surface[hit], atol=2e-5)
    np.testing.assert_allclose(rgb[~hit], result.color[~hit], atol=1e-5)


def test_npz_holds_all_arrays(result, tmp_path):
    result.save(tmp_path / "a.npz")
    result.save(tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    with np.load(tmp_path / "a.npz") as arrays:
        assert set(arrays) == {"color", "depth", "alpha", "z", "metadata", *result.aovs}
        assert np.array_equal(arrays["color"], result.color)
        assert np.array_equal(arrays["normal"], result.aovs["normal"])
        assert json.loads(str(arrays["metadata"]))["sceneName"] == "room"


def test_notebooks_get_a_png(result):
    back = cv2.imdecode(np.frombuffer(result._repr_png_(), np.uint8), cv2.IMREAD_COLOR_RGB)
    assert np.array_equal(back, quantize(result.color))


@pytest.mark.parametrize(
    ("name", "tolerance"), [("a.png", 0.5 / 255), ("a.PNG", 0.5 / 255), ("a.exr", 1e-6), ("a.npz", 0)]
)
def test_saved_pictures_load_again(result, tmp_path, name, tolerance):
    result.save(tmp_path / name)
    expected = result.color if not name.lower().endswith("png") else result.color.clip(0, 1)
    np.testing.assert_allclose(load_picture_file(tmp_path / name), expected, rtol=0, atol=tolerance + 1e-7)


def test_save_refuses_other_extensions(result, tmp_path):
    with pytest.raises(OutputError, match='a.gif: the extension ".gif" is unknown'):
        result.save(tmp_path / "a.gif")


def test_loading_refuses_with_one_sentence(tmp_path):
    np.savez(tmp_path / "other.npz", picture=np.zeros((2, 2, 3)))
    np.savez(tmp_path / "flat.npz", color=np.zeros((2, 2)))
    (tmp_path / "text.npz").write_text("text")
    (tmp_path / "text.png").write_text("text")
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"Y": np.zeros((2, 2), "f")}).write(str(tmp_path / "y.exr"))
    for name, message in {
        "none.npz": "there is no such file",
        "text.npz": "is not a NumPy .npz file",
        "other.npz": "has no array `color`",
        "flat.npz": r"`color` is float64 \(2, 2\); allowed: real numbers \(h, w, 3\)",
        "text.png": "is neither a PNG nor a JPEG",
        "y.exr": "has no channel R",
        "none.exr": "there is no such file",
    }.items():
        with pytest.raises(SceneError, match=f"{name}: .*{message}"):
            load_picture_file(tmp_path / name)
