"""From a mesh file to something that rays can be traced in: our time next to Mitsuba's."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import drjit as dr

import tracer
from reference.adapters.plugins import mesh_plugin
from reference.bench.records import Build, Series
from tracer.backends import find_backend
from tracer.cache import forget_everything
from tracer.device_meshes import placed_meshes
from tracer.device_scene import compile_scene


def builds_of(mesh: str, scene: tracer.Scene, file: Path, peers: Sequence[str], repeat: int) -> list[Build]:
    """Reading the file and building a scene over it, in turn, the first time left out."""
    count = len(next(iter(placed_meshes(scene).values())).corners)
    makers = {"tracer": lambda: _ours(scene), "mitsuba": lambda: _mitsuba(scene, file)}
    found = []
    taken: dict[str, list[tuple[float, float]]] = {peer: [] for peer in peers if peer in makers}
    for number in range(repeat + 1):
        for peer, times in taken.items():
            measured = makers[peer]()
            if number or repeat == 0:
                times.append(measured)
    for peer, times in taken.items():
        read, build = (Series(tuple(part)) for part in zip(*times, strict=True))
        found.append(Build(mesh, count, peer, read, build))
    return found


def _ours(scene: tracer.Scene) -> tuple[float, float]:
    """Triangles from the file; all tables of the scene but for that."""
    backend = find_backend("llvm", "single")
    forget_everything()
    read, _ = _timed(lambda: placed_meshes(scene))
    build, _ = _timed(lambda: compile_scene(scene, backend))
    return read, build


def _mitsuba(scene: tracer.Scene, file: Path) -> tuple[float, float]:
    """Mitsuba's own reader; then a scene over the same triangles in memory, which is Embree's build."""
    from reference.mitsuba_variant import mitsuba

    mi = mitsuba()
    read, _ = _timed(lambda: mi.load_dict({"type": "ply", "filename": str(file), "face_normals": True}))
    mesh = mesh_plugin(mi, "mesh", next(iter(placed_meshes(scene).values())).corners)
    dr.sync_thread()
    build, _ = _timed(
        lambda: mi.load_dict({"type": "scene", "embree_use_robust_intersections": True, "mesh": mesh})
    )
    return read, build


def _timed(function: Any) -> tuple[float, Any]:
    started = time.perf_counter()
    value = function()
    dr.sync_thread()
    return time.perf_counter() - started, value
