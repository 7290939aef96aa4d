"""Adaptive pictures: every pixel is that of the full grid or of its middle ray, and no other setting has a
say in which."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np
import pytest

import tracer
from tests.accuracy import worlds
from tracer import adaptive, contrast, first_hits, kept_bands
from tracer.backends import find_backend
from tracer.errors import UsageError
from tracer.film.counts import counts_in
from tracer.film.work_file import WorkFile
from tracer.render import RenderInterrupted
from tracer.tiles import few_lengths, lane_count, lane_pixels, tile_order

ROOM = worlds.FEATURES["disk jitter"]
THRESHOLD = 0.15


def scene_of(n: int = 3, table: dict[str, Any] | None = None, **camera: Any) -> tracer.Scene:
    table = table or ROOM()
    return tracer.load(table | {"camera": table["camera"] | {"supersample": n} | camera})


def arrays_of(result: tracer.Result) -> dict[str, np.ndarray]:
    assert result.z is not None
    return {"color": result.color, "alpha": result.alpha, "z": result.z} | result.aovs


def middle_rays(scene: tracer.Scene, n: int, **settings: Any) -> tracer.Result:
    """The picture of one ray a pixel, which is sub-ray ((n - 1)/2, (n - 1)/2) of its grid of n x n."""
    scene = scene.model_copy(deep=True)
    scene.camera.pixel_offset = ((n - 1) // 2 + 0.5) / n
    return tracer.render(scene, supersample=1, **settings)


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("n", [2, 3])
def test_nothing_is_left_out_at_threshold_0(precision: str, n: int) -> None:
    scene = scene_of(n)
    full = arrays_of(tracer.render(scene, precision=precision, aovs="all"))
    settings = {"supersample": "adaptive", "threshold": 0, "precision": precision, "aovs": "all"}
    result = tracer.render(scene, rays_per_band=2000, **settings)
    assert result.stats["refined_pixels"] == result.depth.size
    assert {
        name for name, layer in arrays_of(result).items() if layer.tobytes() != full[name].tobytes()
    } == set()


def test_lists_of_pixels_go_in_bundles_as_well(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """What primary rays meet among triangles, found in bundles of whatever pixels follow each other."""
    table = worlds.FEATURES["smooth glass"]()
    scene = tracer.load(table, base_dir=worlds.write_files(tmp_path))
    settings: dict[str, Any] = {"supersample": "adaptive", "threshold": THRESHOLD, "aovs": "all"}
    singly = arrays_of(tracer.render(scene, **settings))
    for threshold in ("FEWEST_RAYS", "SMALLEST_EDGE", "SMALLEST_SHADOW_EDGE", "SMALLEST_SHARE"):
        monkeypatch.setattr(first_hits, threshold, 0)
    bundled = arrays_of(tracer.render(scene, **settings))
    assert {name for name, layer in bundled.items() if layer.tobytes() != singly[name].tobytes()} == set()


@pytest.mark.parametrize("n", [2, 3, 4])
@pytest.mark.parametrize("linear", [False, True])
def test_pixels_are_refined_where_they_differ_from_a_neighbor(n: int, linear: bool) -> None:
    table = ROOM() | {"color_space": "linear" if linear else "display"}
    scene = scene_of(n, table)
    full, middle = tracer.render(scene, aovs="all"), middle_rays(scene, n, aovs="all")
    result = tracer.render(scene, supersample="adaptive", threshold=THRESHOLD, aovs="all")
    seen = np.concatenate([np.clip(middle.color, 0, 1), middle.alpha[..., None]], axis=2)
    height, width = result.depth.shape
    refined = np.zeros((height, width), bool)
    for y in range(height):
        for x in range(width):
            for j, i in ((y, x - 1), (y, x + 1), (y - 1, x), (y + 1, x)):
                if 0 <= i < width and 0 <= j < height:
                    refined[y, x] |= np.abs(seen[y, x] - seen[j, i]).max() >= THRESHOLD
    assert result.stats["refined_pixels"] == refined.sum() and 0.1 < refined.mean() < 0.9
    whole, rough = arrays_of(full), arrays_of(middle)
    for name, layer in arrays_of(result).items():
        assert layer[refined].tobytes() == whole[name][refined].tobytes(), name
        assert layer[~refined].tobytes() == rough[name][~refined].tobytes(), name
    primary = result.stats["rays"]["primary"]
    assert primary == height * width + n * n * refined.sum()


def test_the_first_ray_is_one_of_the_grid() -> None:
    """That in the middle; the last one before it where there is none. So threshold 1 shows sub-rays."""
    table = worlds.room()
    for n, number in ((2, 0), (3, 4), (4, 5)):
        scene = scene_of(n, table)
        result = tracer.render(scene, supersample="adaptive", threshold=1.0, precision="double")
        rough = np.argwhere(result.color != tracer.render(scene, precision="double").color)[::997, :2]
        for y, x in rough:
            tree = tracer.pixel_tree(scene, int(x), int(y), precision="double")
            ray = np.sum([ray.contribution for ray in tree.sub_rays[number].walk()], axis=0) * n * n
            assert np.abs(ray - result.color[y, x]).max() < 1e-12
        assert len(rough) > 2


def put_together(scene: tracer.Scene, **settings: Any) -> dict[str, np.ndarray]:
    """A picture from four crops."""
    width, height = scene.camera.resolution
    columns, rows = (0, width // 3 + 1, width), (0, height // 2 + 3, height)
    bands = []
    for y0, y1 in zip(rows, rows[1:], strict=False):
        crops = [
            arrays_of(tracer.render(scene, crop=(x0, y0, x1, y1), **settings))
            for x0, x1 in zip(columns, columns[1:], strict=False)
        ]
        bands.append({name: np.concatenate([crop[name] for crop in crops], axis=1) for name in crops[0]})
    return {name: np.concatenate([band[name] for band in bands]) for name in bands[0]}


@pytest.mark.parametrize("lens", [None, {"focus": 20.0, "samples": 4, "seed": 3}], ids=["sharp", "lens"])
def test_crops_put_together_are_the_whole(
    lens: dict[str, Any] | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pixel at the edge of a crop is decided by neighbors outside of it: without them crops differ."""
    scene = scene_of(2, depth_of_field=lens)
    settings: dict[str, Any] = {"supersample": "adaptive", "threshold": THRESHOLD, "aovs": "all"}
    whole = arrays_of(tracer.render(scene, **settings))
    parts = put_together(scene, **settings)
    assert {name for name, layer in whole.items() if layer.tobytes() != parts[name].tobytes()} == set()
    for module in (adaptive, contrast):
        monkeypatch.setattr(module, "MARGIN", 0)
    assert (put_together(scene, **settings)["rays"] != whole["rays"]).any()


def test_bands_and_threads_change_nothing() -> None:
    scene = scene_of()
    settings: dict[str, Any] = {"supersample": "adaptive", "aovs": "all", "count_hits": True}
    whole = tracer.render(scene, **settings)
    for others in ({"rays_per_band": 1}, {"rays_per_band": 3000, "threads": 1}):
        result = tracer.render(scene, **settings, **others)
        assert counts_in(result.stats) == counts_in(whole.stats)
        assert all(
            layer.tobytes() == arrays_of(whole)[name].tobytes() for name, layer in arrays_of(result).items()
        )


def test_progress_only_grows_and_ends_at_the_whole() -> None:
    told: list[tuple[int, int, int]] = []
    scene = scene_of()
    settings: dict[str, Any] = {"supersample": "adaptive", "rays_per_band": 2000}
    result = tracer.render(scene, progress=lambda *news: told.append(news), **settings)
    assert [news[0] for news in told] == sorted(news[0] for news in told)
    assert told[0][0] == told[0][2] == 0 and told[-1][0] == told[-1][1] == 2 * result.depth.size
    assert told[-1][2] == sum(result.stats["rays"].values())


def test_an_interrupted_picture_holds_what_was_refined(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also: another threshold is another picture."""
    monkeypatch.setattr(kept_bands, "PATIENCE", 0)
    scene = scene_of()
    calls = 0

    def stop(done: int, total: int, rays: int) -> None:
        nonlocal calls
        calls += done > total // 2
        if calls == 2:
            raise KeyboardInterrupt

    settings: dict[str, Any] = {"supersample": "adaptive", "threshold": THRESHOLD, "rays_per_band": 2000}
    work = WorkFile(tmp_path / "a.work")
    with pytest.raises(RenderInterrupted) as caught:
        tracer.render(scene, progress=stop, work=work, **settings)
    work.close()
    whole, rough = tracer.render(scene, **settings), middle_rays(scene, 3)
    partial = caught.value.partial
    assert 0 < partial.stats["refined_pixels"] < whole.stats["refined_pixels"]
    same = (partial.color == whole.color).all(axis=2)
    assert (partial.color[~same] == rough.color[~same]).all() and 0 < (~same).sum()
    for changes, name in (
        ({"threshold": 0.05}, "threshold"),
        ({"supersample": 3, "threshold": None}, "supersample"),
    ):
        with pytest.raises(UsageError, match=f"was begun with another `{name}`"):
            tracer.render(scene, work=WorkFile(tmp_path / "a.work", resume=True), **(settings | changes))


def test_no_kernel_belongs_to_a_number_of_pixels() -> None:
    scene = scene_of()
    tracer.render(scene, supersample="adaptive", threshold=0.5)
    for threshold in (0.0, 0.03, 0.2):
        result = tracer.render(scene, supersample="adaptive", threshold=threshold, resolution=(57, 43))
        assert result.kernels["compiled"] == 0


def test_how_fine_the_grid_is() -> None:
    for own, n in ((1, 3), (2, 2), (5, 5)):
        result = tracer.render(scene_of(own), supersample="adaptive", threshold=0, resolution=(9, 7))
        assert result.stats["supersample"] == n and result.stats["threshold"] == 0
        assert result.stats["rays"]["primary"] == 9 * 7 * (1 + n * n)


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"supersample": "adaptive", "threshold": 1.5}, "threshold: 1.5 is out of range; allowed is 0 to 1"),
        ({"supersample": "adaptive", "threshold": float("nan")}, "threshold: nan is out of range"),
        ({"threshold": 0.1}, "threshold: 0.1 has a meaning only where supersample is adaptive"),
        ({"supersample": "often"}, "supersample: often is out of range; allowed is 1 to 64, or adaptive"),
    ],
)
def test_what_is_refused(settings: dict[str, Any], text: str) -> None:
    with pytest.raises(UsageError, match=text):
        tracer.render(scene_of(), **settings)
    with pytest.raises(UsageError, match="the tree of a pixel shows all its sub-rays"):
        tracer.pixel_tree(scene_of(), 0, 0, supersample="adaptive")  # type: ignore[arg-type]


def test_lists_have_the_order_of_lanes() -> None:
    backend = find_backend("llvm", "single")
    width, height = 43, 29
    mask = np.random.default_rng(3).random((height, width)) < 0.4
    lanes = dr.arange(backend.UInt32, lane_count(width, height))
    column, row, active = (values.numpy() for values in lane_pixels(backend, width, height, lanes))
    listed = [(x, y) for x, y, owns in zip(column, row, active, strict=True) if owns and mask[y, x]]
    assert list(zip(*map(list, tile_order(mask)), strict=True)) == listed


def test_lengths_are_few() -> None:
    lengths = {few_lengths(count) for count in range(1, 1 << 14)}
    assert all(few_lengths(count) >= count for count in range(1, 1 << 14))
    assert all(length % 64 == 0 for length in lengths) and len(lengths) < 50
    assert few_lengths(100_000) < 125_000
