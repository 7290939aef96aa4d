"""Traces the tree of rays of one pixel, level by level, with the functions of the renderer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from tracer.backends import exact_arithmetic, find_backend
from tracer.canvas import DeviceCanvas
from tracer.device_scene import DeviceScene, compile_scene
from tracer.errors import UsageError
from tracer.intersection import closest_hit
from tracer.lens_lights import LightsUnderTheLens, picked
from tracer.lens_nodes import Columns, NodesUnderTheLens
from tracer.pixels import PixelGrid
from tracer.ray_tree import PixelTree, RayNode
from tracer.scene import Scene
from tracer.settings import Settings, picture_canvas, with_seed
from tracer.spawn import material_at, spawn
from tracer.surface import surface_at
from tracer.textures.tables import texture_color
from tracer.whitted import primary_path, texture_point


def pixel_tree(
    scene: Scene,
    x: int,
    y: int,
    precision: str = "single",
    backend: str = "auto",
    supersample: int | None = None,
    *,
    scale: float = 1.0,
    resolution: tuple[int, int] | None = None,
    seed: int | None = None,
) -> PixelTree:
    """The tree of rays of pixel (column x, row y) of the picture that `tracer.render` gives with the same
    settings; raises what that raises, and `UsageError` for a pixel outside the picture."""
    settings = Settings(precision, backend, supersample, (), scale, resolution, seed=seed).checked()
    if settings.adaptive:
        raise UsageError("supersample: the tree of a pixel shows all its sub-rays; allowed is 1 to 64")
    types = find_backend(settings.backend, settings.precision)
    scene = with_seed(scene, seed)
    canvas = picture_canvas(scene, settings)
    if not (0 <= x < canvas.width and 0 <= y < canvas.height):
        raise UsageError(
            f"pixel: {x} {y} is outside the picture; allowed is 0 <= X < {canvas.width} "
            f"and 0 <= Y < {canvas.height}"
        )
    n = settings.grid(scene)
    with exact_arithmetic():
        lens = _Lens(scene, compile_scene(scene, types))
        roots = lens.look(DeviceCanvas.of(types, canvas), x, y, y * canvas.width + x, n)
    return PixelTree(scene.name, x, y, n, scene.color_space == "linear", types.precision, tuple(roots))


LANES = 64
"""Rays of a level come in multiples of so many lanes, the last ray repeated: which kernels Dr.Jit makes of
the code depends on which arrays are of one length, and on which hold a single number."""


def lanes_for(rays: int) -> int:
    """The lanes of a level of so many rays."""
    return -(-rays // LANES) * LANES


@dataclass
class _Level:
    """The rays of one level: `paths` and the numbers of their sub-rays, by lane, and for each ray its kind,
    its factor and the list of nodes that it belongs to."""

    paths: Any
    sub_rays: np.ndarray
    kinds: list[str]
    factors: list[float]
    homes: list[list[RayNode]]


class _Lens:
    """A scene, and the pixel that is looked at."""

    def __init__(self, scene: Scene, device: DeviceScene) -> None:
        self.scene, self.device, self.backend = scene, device, device.backend
        self.lights = LightsUnderTheLens(scene, device)

    def look(self, canvas: DeviceCanvas, x: int, y: int, number: int, n: int) -> list[RayNode]:
        """The trees of the pixel's sub-rays."""
        backend, count = self.backend, n * n
        width = lanes_for(count)
        sub_rays = np.minimum(np.arange(width), count - 1)
        lane = backend.id_table(sub_rays)
        column, row, numbers = (dr.opaque(backend.UInt32, value, width) for value in (x, y, number))
        self.pixel = number
        active = dr.full(backend.Bool, True, width)
        pixels = PixelGrid(lane, backend.opaque_id(count), column, row, numbers, backend.opaque_id(n), active)
        self.nodes = NodesUnderTheLens(self.scene, self.device, 1 / count)
        roots: list[RayNode] = []
        level: _Level | None = _Level(
            primary_path(self.device, canvas, pixels, lane),
            sub_rays,
            ["primary"] * count,
            [1.0] * count,
            [roots] * count,
        )
        while level is not None:
            level = self._trace(level)
        return roots

    def _trace(self, level: _Level) -> _Level | None:
        """Adds the nodes of a level, and gives the next one."""
        device, backend, path = self.device, self.backend, level.paths
        width, rays = len(level.sub_rays), len(level.kinds)
        everything = dr.full(backend.Bool, True, width)
        hit = closest_hit(device, path.ray, everything)
        surface = surface_at(device, path.ray, hit, everything)
        material = material_at(device, surface, hit.valid)
        own = texture_color(
            backend, device.textures, material.texture, texture_point(device, surface, hit.valid), hit.valid
        )
        base = path.throughput * own * device.not_ambient
        children = spawn(device, path, surface, material, base, hit.valid)
        dr.eval(hit, surface, material, own, children)
        number = dr.opaque(backend.UInt32, self.pixel, width)
        sub_ray = backend.id_table(level.sub_rays)
        lights = self.lights.terms(rays, path, surface, material, hit.valid, number, sub_ray)
        seen = Columns(width, path, hit, surface, material, own, children)
        told = zip(level.kinds, level.factors, lights, strict=True)
        nodes = [self.nodes.node(*each, seen, i) for i, each in enumerate(told)]
        for home, node in zip(level.homes, nodes, strict=True):
            home.append(node)
        return self._next(level, nodes, children, seen)

    def _next(self, level: _Level, nodes: list[RayNode], children: Any, seen: Columns) -> _Level | None:
        """The children that are traced, those of one ray side by side."""
        rows = [
            (i, is_mirrored)
            for i in range(len(level.kinds))
            for is_mirrored, traced in ((True, seen.reflects[i]), (False, seen.refracts[i]))
            if traced
        ]
        if not rows:
            return None
        in_lanes = np.minimum(np.arange(lanes_for(len(rows))), len(rows) - 1)
        parents = np.array([i for i, _ in rows])
        lanes = parents[in_lanes]
        mirrored = np.array([is_mirrored for _, is_mirrored in rows])[in_lanes]
        index = self.backend.id_table(lanes)
        first, second = (picked(path, index) for path in (children.reflected, children.refracted))
        paths = dr.select(self.backend.id_table(mirrored) != 0, first, second)
        dr.eval(paths)
        second_kinds = ["total_reflection" if seen.total[i] else "refracted" for i in parents]
        return _Level(
            paths,
            level.sub_rays[lanes],
            ["reflected" if one else other for (_, one), other in zip(rows, second_kinds, strict=True)],
            [float((seen.reflection if one else seen.refraction)[i]) for i, one in rows],
            [nodes[i].children for i in parents],
        )
