"""No kernel is compiled after the first frame of an animation, whatever moves."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np
import pytest

import tracer
from tests.accuracy import worlds
from tracer import first_hits
from tracer.backends import CACHE_LINE, find_backend
from tracer.cache import forget_everything
from tracer.replay import forget_recordings

MESH = {"name": "ball", "kind": "mesh", "file": "ico.obj", "scale": 2.0, "translate": [0.3, 2.1, -1.2]}
LENS = {"focus": 4.0, "samples": 4, "depth_range": 3.0}


def moving(folder: Path, key: str, *values: Any, **table: Any) -> tracer.Scene:
    """A room with a mesh and point lights in which one key changes from frame to frame."""
    room = worlds.room(lights=[dict(light) for light in worlds.POINT_LIGHTS])
    room["shapes"] = [*room["shapes"], MESH]
    room["animation"] = [{"key": key, "times": list(range(1, len(values) + 1)), "values": list(values)}]
    return tracer.load(room | table, base_dir=worlds.write_files(folder))


def kernels(scene: tracer.Scene, **settings: Any) -> set[str]:
    """Of one frame."""
    dr.kernel_history_clear()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        tracer.render(scene, animated=True, **settings)
        return {entry["hash"] for entry in dr.kernel_history([dr.KernelType.JIT])}


def new_kernels(scene: tracer.Scene, frames: int, **settings: Any) -> list[int]:
    """How many each frame after the first one launches that no frame before did; nothing is kept from other
    renders."""
    forget_everything()
    forget_recordings()
    known = kernels(scene.at(1), **settings)
    assert known
    found = []
    for frame in range(2, frames + 1):
        launched = kernels(scene.at(frame), **settings)
        found.append(len(launched - known))
        known |= launched
    return found


NEAR, FAR = [0.3, 2.1, 5.0], [0.3, 2.1, 400.0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("camera.origin", (FAR, NEAR)),
        ("camera.origin", (NEAR, FAR)),
        ("shapes.ball.translate", ([40.0, 2.1, -1.2], [0.3, 2.1, -1.2], [0.4, 3.0, -1.2])),
        ("shapes.ball.scale", (1e-3, 2.0)),
        ("lights.1.weight", (0, 1.0, 0)),
    ],
)
def test_what_moves_compiles_nothing(
    key: str, values: tuple[Any, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whether bundles pay, whether one of their rays needs another kernel, and whether a light is on."""
    monkeypatch.setattr(first_hits, "FEWEST_RAYS", 0)
    camera = {"origin": NEAR, "target": [0.3, 2.1, -1.2], "fov": 60.0, "resolution": [64, 48]}
    assert not any(new_kernels(moving(tmp_path, key, *values, camera=camera), len(values)))


@pytest.mark.slow
@pytest.mark.parametrize("settings", [{}, {"crop": (9, 7, 50, 40)}])
def test_a_focus_that_moves_compiles_nothing(settings: dict[str, Any], tmp_path: Path) -> None:
    """From pixels that are mixed with a few neighbors to such that are with all."""
    camera = worlds.room()["camera"] | {"depth_of_field": LENS, "resolution": [128, 96]}
    scene = moving(tmp_path, "camera.depth_of_field.focus", 4.0, 4000.0, 4.0, camera=camera)
    assert not any(new_kernels(scene, 3, **settings))


@pytest.mark.slow
def test_an_adaptive_picture_compiles_nothing_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where fewer pixels are refined than pay for bundles, and then more."""
    monkeypatch.setattr(first_hits, "FEWEST_RAYS", 4000)
    scene = moving(tmp_path, "shapes.ball.translate", [40.0, 2.1, -1.2], [0.3, 2.1, -1.2])
    settings = {"supersample": "adaptive", "threshold": 0.3, "resolution": (64, 48)}
    assert not any(new_kernels(scene, 2, **settings))


def test_no_byte_depends_on_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With bundles and without, and with a light that has no weight yet."""
    scene = moving(tmp_path, "lights.1.weight", 0.0, 1.0).at(1)
    for enough in (0, 1 << 40):
        monkeypatch.setattr(first_hits, "FEWEST_RAYS", enough)
        for edge in (0.0, 1e9):
            monkeypatch.setattr(first_hits, "SMALLEST_EDGE", edge)
            one, other = (tracer.render(scene, aovs="all", animated=animated) for animated in (True, False))
            assert one.color.tobytes() == other.color.tobytes()
            assert all(one.aovs[name].tobytes() == other.aovs[name].tobytes() for name in one.aovs)
            counts = [{**result.stats, "seconds": None} for result in (one, other)]
            assert counts[0] == counts[1]


def test_uploads_are_the_same_kernel_wherever_numpy_has_its_memory() -> None:
    backend = find_backend("llvm")
    room = np.arange(64, dtype=np.float32)
    first = -room.ctypes.data % CACHE_LINE // room.itemsize
    found = []
    for begin in (first, first + 1):
        dr.kernel_history_clear()
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            table = backend.table(room[begin : begin + 24])
            found.append({entry["hash"] for entry in dr.kernel_history([dr.KernelType.JIT])})
        assert table.numpy().tolist() == room[begin : begin + 24].tolist()
    assert found[0] == found[1]


@pytest.mark.slow
def test_a_turntable_compiles_nothing_after_its_first_frame(repository: Path, tmp_path: Path) -> None:
    """The real command, with an empty cache of kernels."""
    (tmp_path / "kernels").mkdir()
    variables = {**os.environ, "PYTHONPATH": str(repository), "DRJIT_CACHE_DIR": str(tmp_path / "kernels")}
    command = (*("turntable", "classic", "--frames", "5", "--scale", "0.5"), *("-o", "t.png", "--stats"))
    done = subprocess.run(
        [sys.executable, "-m", "tracer.cli", *command],
        cwd=tmp_path,
        env=variables,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    kernels = json.loads((tmp_path / "t.stats.json").read_text())["kernels"]
    assert kernels["compiled"] > 10 and kernels["compiled_later"] == 0, kernels
