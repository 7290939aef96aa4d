"""A picture that is interrupted again and again and resumed is the picture, its counts included."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import tracer
from tests.accuracy import worlds
from tests.unit.mesh_writers import Gltf
from tracer import kept_bands
from tracer.errors import UsageError
from tracer.film.work_file import WorkFile
from tracer.render import RenderInterrupted

SETTINGS: dict[str, Any] = {"aovs": ("depth", "normal", "shape"), "supersample": 2}
ADAPTIVE: dict[str, Any] = SETTINGS | {"supersample": "adaptive", "threshold": 0.02, "count_hits": True}


@pytest.fixture(autouse=True)
def impatience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bands are kept at once."""
    monkeypatch.setattr(kept_bands, "PATIENCE", 0)


def pieces(scene: tracer.Scene, file: Path, sizes: list[int], **settings: Any) -> tracer.Result:
    """The picture, made by runs of two bands each; each run has the next of these sizes of its bands."""
    for run in range(1000):
        work = WorkFile(file, resume=run > 0)
        calls = 0

        def progress(done: int, total: int, rays: int) -> None:
            nonlocal calls
            calls += rays > 0
            if calls == 2:
                raise KeyboardInterrupt

        size = sizes[run % len(sizes)]
        try:
            return tracer.render(
                scene, rays_per_band=size, progress=progress, work=work, **(SETTINGS | settings)
            )
        except RenderInterrupted as interrupted:
            assert (interrupted.partial.depth != -1).any() or run < 3
        finally:
            work.close()
    raise AssertionError("no end")


@pytest.mark.parametrize("sizes", [[3000], [1024, 9000, 512]])
@pytest.mark.parametrize("crop", [None, (3, 2, 30, 21)])
@pytest.mark.parametrize("settings", [SETTINGS, ADAPTIVE], ids=["full grid", "adaptive"])
def test_resumed_pictures_are_the_same(
    settings: dict[str, Any], sizes: list[int], crop: tuple[int, int, int, int] | None, tmp_path: Path
) -> None:
    table = worlds.FEATURES["disk jitter"]()
    table["camera"] = table["camera"] | {"depth_of_field": {"focus": 20.0, "samples": 4, "seed": 3}}
    scene = tracer.load(table)
    whole = tracer.render(scene, crop=crop, **settings)
    resumed = pieces(scene, tmp_path / "a.work", sizes, crop=crop, **settings)
    assert resumed.color.tobytes() == whole.color.tobytes()
    for name, layer in whole.aovs.items():
        assert resumed.aovs[name].tobytes() == layer.tobytes()
    counts = {key: value for key, value in whole.stats.items() if key != "seconds"}
    assert {key: value for key, value in resumed.stats.items() if key != "seconds"} == counts


def test_the_time_of_earlier_runs_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = tracer.load(worlds.FEATURES["disk jitter"]())
    clock = iter(range(0, 10**9, 100))
    monkeypatch.setattr("tracer.kept_bands.time.perf_counter", lambda: next(clock))
    assert pieces(scene, tmp_path / "a.work", [3000]).stats["seconds"]["trace"] > 100


def test_files_of_the_scene_count_as_well(tmp_path: Path) -> None:
    """What a mesh file holds, and the buffer beside a glTF file."""
    triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    (tmp_path / "a.obj").write_text(triangle)
    gltf = Gltf()
    gltf.mesh(gltf.primitive([(0, 0, 1), (1, 0, 1), (0, 1, 1)]))
    (tmp_path / "b.gltf").write_bytes(gltf.json(uri="its buffer.bin"))
    (tmp_path / "its buffer.bin").write_bytes(gltf.data)
    table = worlds.FEATURES["disk jitter"]()
    table["shapes"] = [*table["shapes"], *({"kind": "mesh", "file": name} for name in ("a.obj", "b.gltf"))]
    scene = tracer.load(table, base_dir=tmp_path)
    work = WorkFile(tmp_path / "a.work")
    tracer.render(scene, rays_per_band=600, work=work)
    work.close()
    resumed = WorkFile(tmp_path / "a.work", resume=True)
    tracer.render(scene, work=resumed)
    resumed.close()
    for shape, file in enumerate(("a.obj", "its buffer.bin"), len(table["shapes"]) - 2):
        before = (tmp_path / file).read_bytes()
        (tmp_path / file).write_bytes(before + b"#")
        with pytest.raises(UsageError, match=rf"another `shapes\.{shape}\.file \(what the file holds\)`"):
            tracer.render(scene, work=WorkFile(tmp_path / "a.work", resume=True))
        (tmp_path / file).write_bytes(before)
