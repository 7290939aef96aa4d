"""What a render counts is true, is the same whatever it is cut into, and stands in its files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import drjit as dr
import pytest

import tracer
from tests.accuracy import worlds
from tracer import kept_bands
from tracer.film.counts import counts_in, together
from tracer.film.exr import read_exr
from tracer.film.work_file import WorkFile
from tracer.render import RenderInterrupted


@pytest.mark.parametrize("precision", ["single", "double"])
def test_hits_are_those_of_the_trees_of_rays(precision: str) -> None:
    scene = tracer.load(worlds.room())
    settings: dict[str, Any] = {"precision": precision, "supersample": 2, "resolution": (16, 12)}
    crop = (2, 4, 8, 9)
    result = tracer.render(scene, crop=crop, count_hits=True, **settings)
    expected = [0] * len(scene.shapes)
    x0, y0, x1, y1 = crop
    for x, y in ((x, y) for x in range(x0, x1) for y in range(y0, y1)):
        for ray in tracer.pixel_tree(scene, x, y, **settings).rays():
            if ray.hit is not None:
                expected[ray.hit.shape] += 1
    assert result.stats["hits"] == expected
    assert sum(count > 0 for count in expected) > 3


def test_counting_hits_changes_nothing_else() -> None:
    scene = tracer.load(worlds.FEATURES["disk jitter"]())
    plain, counted = (tracer.render(scene, aovs="all", count_hits=wanted) for wanted in (False, True))
    assert counted.color.tobytes() == plain.color.tobytes()
    assert all(counted.aovs[name].tobytes() == layer.tobytes() for name, layer in plain.aovs.items())
    hits = counted.stats.pop("hits")
    assert "hits" not in plain.stats and counts_in(counted.stats) == counts_in(plain.stats)
    bands = tracer.render(scene, rays_per_band=700, threads=1, count_hits=True)
    assert bands.stats["hits"] == hits


def test_parts_without_hits_make_the_whole_unknown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_bands, "PATIENCE", 0)
    scene = tracer.load(worlds.room())

    def stop(done: int, total: int, rays: int) -> None:
        if done:
            raise KeyboardInterrupt

    def begun(count_hits: bool) -> WorkFile:
        work = WorkFile(tmp_path / "a.work")
        with pytest.raises(RenderInterrupted):
            tracer.render(scene, rays_per_band=512, progress=stop, work=work, count_hits=count_hits)
        work.close()
        return WorkFile(tmp_path / "a.work", resume=True)

    whole = tracer.render(scene, count_hits=True)
    for before, now in ((True, True), (False, True), (True, False)):
        work = begun(before)
        result = tracer.render(scene, work=work, count_hits=now)
        work.close()
        wanted = counts_in(whole.stats)
        if not (before and now):
            del wanted["hits"]
        assert counts_in(result.stats) == wanted


def test_counts_of_two_parts() -> None:
    some = {"rays": {"primary": 1, "shadow": 2}, "deepest_level": 3, "hits": [1, 2], "ended_by_depth": 1}
    more = {"rays": {"primary": 5, "shadow": 7}, "deepest_level": 2, "ended_by_depth": 1}
    assert together(some, more) == {
        "rays": {"primary": 6, "shadow": 9},
        "deepest_level": 3,
        "ended_by_depth": 2,
    }
    assert together(some, some)["hits"] == [2, 4]


def test_files_hold_counts_and_no_times(tmp_path: Path) -> None:
    scene = tracer.load(worlds.room())
    headers = []
    for name, settings in {"a": {}, "b": {"threads": 1, "rays_per_band": 700}}.items():
        result = tracer.render(scene, count_hits=True, **settings)
        result.save(tmp_path / f"{name}.exr")
        headers.append(read_exr(tmp_path / f"{name}.exr")[1])
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()
    stats = result.stats
    assert headers[0]["raysPrimary"] == stats["rays"]["primary"]
    assert headers[0]["raysTotalReflection"] == stats["rays"]["total_reflection"]
    assert headers[0]["deepestLevel"] == stats["deepest_level"]
    assert headers[0]["pathsEndedByWeight"] == stats["ended_by_cutoff"]
    assert headers[0]["pathsEndedByDepth"] == stats["ended_by_depth"]
    assert headers[0]["hitsPerShape"] == " ".join(map(str, stats["hits"]))
    assert not any("second" in name.lower() or "kernel" in name.lower() for name in headers[0])


def test_kernels_are_counted_and_nobody_elses_record_is_touched() -> None:
    scene = tracer.load(worlds.room())
    tracer.render(scene)
    again = tracer.render(scene)
    assert again.kernels["compiled"] == 0 and again.kernels["reused"] > 0
    assert again.stats["seconds"].keys() == {"build", "compile", "trace", "filter"}
    assert not dr.flag(dr.JitFlag.KernelHistory)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        assert sum(tracer.render(scene).kernels.values()) == 0
        assert dr.kernel_history()
