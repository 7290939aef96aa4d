"""The same bytes however a picture is computed, and no new kernel when only numbers change."""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np
import pytest

import tracer
from tests.accuracy import worlds
from tracer.cache import forget_everything
from tracer.replay import forget_recordings


def picture(table: dict[str, Any], **settings: Any) -> tracer.Result:
    return tracer.render(tracer.load(table), aovs=("depth", "normal", "shape"), **settings)


def same_bytes(a: tracer.Result, b: tracer.Result) -> bool:
    layers = all(a.aovs[name].tobytes() == b.aovs[name].tobytes() for name in a.aovs)
    return a.color.tobytes() == b.color.tobytes() and a.depth.tobytes() == b.depth.tobytes() and layers


@pytest.mark.parametrize("rays_per_band", [1, 300, 1000, 5000])
def test_band_size_changes_no_byte(rays_per_band: int) -> None:
    table = worlds.FEATURES["disk jitter"]()
    whole, bands = picture(table), picture(table, rays_per_band=rays_per_band)
    assert same_bytes(whole, bands)
    rays = {key: value for key, value in whole.stats.items() if key != "seconds"}
    assert rays == {key: value for key, value in bands.stats.items() if key != "seconds"}


def test_thread_count_changes_no_byte() -> None:
    table = worlds.FEATURES["disk jitter"]()
    assert same_bytes(picture(table, threads=1), picture(table, threads=2))


def test_numbers_near_zero_are_the_same_in_all_threads() -> None:
    """Highlights that fade below the smallest normal number: Dr.Jit's own threads flush such numbers to zero,
    and so does the calling one, which has all the work with one thread and for a single pixel."""
    scene = tracer.load("optics_mirror")

    def layers(threads: int, crop: tuple[int, int, int, int] | None = None) -> dict[str, Any]:
        return tracer.render(scene, aovs="all", resolution=(96, 72), threads=threads, crop=crop).aovs

    shared = layers(2)
    dim = shared["specular"][..., 0]
    assert dim[dim > 0].min() >= np.finfo(np.float32).smallest_normal
    row, column = map(int, np.argwhere(dim == dim[dim > 0].min())[0])
    one, three, pixel = layers(1), layers(3), layers(2, (column, row, column + 1, row + 1))
    for name, layer in shared.items():
        assert layer.tobytes() == one[name].tobytes() == three[name].tobytes(), name
        assert layer[row, column].tobytes() == pixel[name].tobytes(), name
    assert (np.float32(1e-30) * np.full(4, 1e-9, np.float32)).all(), (
        "the calling thread has its own ways again"
    )


@pytest.mark.parametrize("crop", [(0, 0, 9, 7), (13, 5, 32, 24)])
def test_crop_changes_no_byte(crop: tuple[int, int, int, int]) -> None:
    table = worlds.FEATURES["disk jitter"]()
    x0, y0, x1, y1 = crop
    assert np.array_equal(picture(table, crop=crop).color, picture(table).color[y0:y1, x0:x1])


def test_a_supersampled_pixel_is_the_mean_of_finer_pixels() -> None:
    table = worlds.room()
    camera = table["camera"] | {"resolution": [64, 48], "pixel_size": table["camera"]["pixel_size"] / 2}
    fine = picture(table | {"camera": camera}, precision="double").color
    coarse = picture(table, precision="double", supersample=2).color
    assert np.abs(fine.reshape(24, 2, 32, 2, 3).mean(axis=(1, 3)) - coarse).max() < 1e-12


UPLOAD = 100
"""Operations: smaller kernels only copy numbers."""


def kernels_of(table: dict[str, Any], **settings: Any) -> list[dict[str, Any]]:
    """The kernels that one render launches where nothing is kept from those before."""
    scene = tracer.load(table)
    forget_everything()
    forget_recordings()
    dr.kernel_history_clear()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        tracer.render(scene, **settings)
        return [entry for entry in dr.kernel_history() if entry["type"] == dr.KernelType.JIT]


def changed(path: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """A room with another number in one place, and settings."""
    table, settings = worlds.room(), {}
    table["shapes"] = [dict(shape) for shape in table["shapes"]]
    table["lights"] = [dict(light) for light in table["lights"]]
    if path == "color":
        table["shapes"][4]["color"] = "#123456"
    elif path == "position":
        table["shapes"][3]["center"] = [0.5, 1.3, 1.0]
    elif path == "camera angle":
        table["camera"] = table["camera"] | {"rotate": [3.0, -4.0]}
    elif path == "light weight":
        table["lights"][0]["weight"] = 5.0
    elif path == "material":
        table["materials"] = table["materials"] | {"glass": worlds.GLASS | {"ior": 1.7, "refraction": 0.6}}
    elif path == "mesh":
        table["shapes"][5]["translate"] = [3.5, 1.4, -2.5]
    elif path == "cutoff":
        table["cutoff"] = 0.3
    elif path == "supersample":
        settings["supersample"] = 3
    return table, settings


@pytest.mark.parametrize(
    "path", ["color", "position", "camera angle", "light weight", "material", "mesh", "cutoff", "supersample"]
)
def test_a_change_of_numbers_compiles_nothing(path: str) -> None:
    known = {entry["hash"] for entry in kernels_of(worlds.room())}
    table, settings = changed(path)
    kernels = kernels_of(table, **settings)
    new = {entry["hash"] for entry in kernels} - known
    assert kernels
    assert not new, f"{path}: {len(new)} new kernels"


def many_spheres(count: int, seed: int = 3) -> dict[str, Any]:
    """A room with so many spheres, wherever a seed puts them."""
    rng = np.random.default_rng(seed)
    balls = [
        {"kind": "sphere", "center": center.tolist(), "radius": 0.1}
        for center in rng.uniform((-4, 0, -4), (4, 5, 4), (count, 3))
    ]
    return worlds.room(shapes=[*worlds.room()["shapes"], *balls])


@pytest.mark.parametrize("precision", ["single", "double"])
def test_of_many_spheres_one_more_or_elsewhere_compiles_nothing(precision: str) -> None:
    known = {entry["hash"] for entry in kernels_of(many_spheres(40), precision=precision)}
    for table in (many_spheres(41), many_spheres(100), many_spheres(40, seed=4)):
        kernels = kernels_of(table, precision=precision)
        assert kernels
        assert not {entry["hash"] for entry in kernels} - known


def test_a_change_of_structure_is_seen_by_the_check_above() -> None:
    known = {entry["hash"] for entry in kernels_of(worlds.room())}
    assert {entry["hash"] for entry in kernels_of(worlds.room(transparent_shadows=True))} - known


def test_a_larger_stack_is_a_kernel_of_its_own() -> None:
    """Dr.Jit does not see the size of local memory: the kernel of a smaller stack would write beyond its
    own."""
    known = {entry["hash"] for entry in kernels_of(worlds.room(cutoff=0.05))}
    deeper = kernels_of(worlds.room(cutoff=0.004))
    assert {entry["hash"] for entry in deeper if entry["operation_count"] >= UPLOAD} - known
    assert picture(worlds.room(cutoff=0.004)).stats["deepest_level"] <= 64


@pytest.mark.parametrize(("rays_per_band", "bands"), [(1 << 21, 1), (300, 3)])
def test_one_kernel_a_band(rays_per_band: int, bands: int) -> None:
    """The loop is one kernel, the hierarchy over a few triangles, with one lane, another; all others copy
    numbers and are small."""
    kernels_of(worlds.room())
    kernels = kernels_of(worlds.room(), rays_per_band=rays_per_band)
    sizes = [entry["size"] for entry in kernels if entry["operation_count"] >= UPLOAD]
    assert sizes.count(1) == 1 and len(sizes) == 1 + bands


@pytest.mark.slow
def test_symbolic_and_evaluated_loops_agree() -> None:
    table = worlds.room()
    table["shapes"] = table["shapes"][:5]
    table["camera"] = table["camera"] | {"resolution": [8, 6], "pixel_size": 0.9}
    symbolic = picture(table)
    with (
        dr.scoped_set_flag(dr.JitFlag.SymbolicLoops, False),
        dr.scoped_set_flag(dr.JitFlag.SymbolicConditionals, False),
    ):
        evaluated = picture(table)
    assert np.abs(symbolic.color - evaluated.color).max() <= 1e-6
    assert symbolic.stats["rays"] == evaluated.stats["rays"]
