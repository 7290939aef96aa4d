"""A scene as Mitsuba sees it: ray queries, visibility, camera and depth buffer, with our shape numbers.

Nothing of Mitsuba's shading is used. Everything is in single precision, as Embree traces; spheres and disks
are solved by Mitsuba itself. Embree's robust mode is on: without it some 6 % of the rays that are aimed at an
edge pass between its triangles (mitsuba3 issue #1149).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from reference import extended
from reference.adapters import body_of, sensor_of
from reference.adapters.extent import extent_of
from reference.adapters.geometry import Perspective, Triangles
from reference.adapters.plugins import sensor_plugin, shape_plugin
from reference.adapters.shapes import Surroundings
from reference.mitsuba_variant import mitsuba
from tracer.canvas import Canvas
from tracer.device_meshes import placed_meshes
from tracer.scene import Scene

SHADOW_START = 1e-5
"""Visibility rays start and end so far from their ends, in extents S, along themselves: Mitsuba's own rule
moves the start along the normal, and drops blockers within 1e-3 of the light's distance."""


@dataclass(frozen=True)
class Hits:
    """The nearest hits of n rays.

    `t` (n,) distance, inf on a miss; `shape`, `primitive` (n,) int64, -1 on a miss; `p` (n, 3) o + t d in
    double precision from the rounded ray that was traced, `n` (n, 3) outward geometric unit normal, NaN on a
    miss; `valid` (n,) bool.
    """

    t: np.ndarray
    shape: np.ndarray
    primitive: np.ndarray
    p: np.ndarray
    n: np.ndarray
    valid: np.ndarray


@dataclass(frozen=True)
class MitsubaScene:
    """The geometry of a scene in Mitsuba.

    `scene`: mi.Scene; `numbers` (k,) our shape number of each of Mitsuba's k shapes in its order; `sensor`:
    its rays are those of the model, with `supersample` rays a pixel each way; `extent` S: the largest
    |coordinate| in play; `view` the sensor in numbers, `first_view` the same with one ray a pixel; `shape_of`
    our shape number by the number that Mitsuba gave; `primitives`: by shape, primitive numbers of a mesh's
    triangles in Mitsuba.
    """

    scene: Any
    numbers: np.ndarray
    sensor: Any
    extent: float
    view: Perspective
    first_view: Perspective
    shape_of: np.ndarray
    primitives: Mapping[int, np.ndarray]

    def lookup(self, interaction: Any) -> tuple[np.ndarray, np.ndarray]:
        """Our shape and primitive numbers (n,) int64 of a SurfaceInteraction3f or PreliminaryIntersection3f.

        Triangles count in file order, degenerate ones included; -1 on a miss. Mitsuba tells a shape by a
        number that the whole process hands out, in the order of creation, so a table of them is kept.
        """
        shape = self.shape_of[_pointers(interaction.shape)]
        index = interaction.prim_index.numpy().astype(np.int64)
        shape = np.where(interaction.is_valid().numpy(), shape, -1)
        primitive = np.where(shape < 0, -1, 0)
        for number, kept in self.primitives.items():
            here = shape == number
            primitive[here] = kept[index[here]]
        return shape, primitive

    def rays(self, origins: ArrayLike, directions: ArrayLike, t_max: ArrayLike | None = None) -> Any:
        """mi.Ray3f of origins and unit directions (n, 3), rounded to single precision; not normalized."""
        mi = mitsuba()
        o, d = (_columns(mi, values) for values in (origins, directions))
        ray = mi.Ray3f(mi.Point3f(o), mi.Vector3f(d))
        if t_max is not None:
            ray.maxt = mi.Float(np.broadcast_to(np.asarray(t_max, np.float32), len(o[0])).copy())
        return ray

    def intersect(self, origins: ArrayLike, directions: ArrayLike, t_max: ArrayLike | None = None) -> Hits:
        """The nearest hits with 0 < t <= `t_max` (a number or (n,)) along unit directions. Mitsuba counts
        t = 0 as well, the model does not: such rays are asked once more, from a little farther on."""
        o, d = (np.asarray(v, np.float32).astype(np.float64) for v in (origins, directions))
        hits = self._nearest(o, d, t_max)
        k = np.flatnonzero(hits.t == 0)
        if len(k):
            step = SHADOW_START * np.maximum(self.extent, np.abs(o[k]).max(axis=1))
            limit = None if t_max is None else np.broadcast_to(np.asarray(t_max), len(o))[k] - step
            for name, found in vars(self._nearest(o[k] + step[:, None] * d[k], d[k], limit)).items():
                getattr(hits, name)[k] = found + step if name == "t" else found
        return hits

    def _nearest(self, origins: np.ndarray, directions: np.ndarray, t_max: ArrayLike | None) -> Hits:
        """The nearest hits as Mitsuba counts them."""
        import drjit as dr

        if not np.size(origins):
            return _no_hits()  # Dr.Jit ends the process where a query has no rays
        mi, ray = mitsuba(), self.rays(origins, directions, t_max)
        si = self.scene.ray_intersect(ray, mi.RayFlags.Minimal, True)
        dr.eval(si)
        shape, primitive = self.lookup(si)
        valid = shape >= 0
        t = np.where(valid, si.t.numpy().astype(np.float64), np.inf)
        o, d = (vector.numpy().T.astype(np.float64) for vector in (ray.o, ray.d))
        miss = ~valid[:, None]
        p = o + np.where(valid, t, np.nan)[:, None] * d
        n = np.where(miss, np.nan, si.n.numpy().T.astype(np.float64))
        return Hits(t, shape, primitive, p, n, valid)

    def visible(self, points: ArrayLike, targets: ArrayLike) -> np.ndarray:
        """(n,) bool: nothing lies between points and targets (n, 3), 1e-5 S at either end left out.

        By nearest hits: Mitsuba's `ray_test` is off at the silhouettes of small and distant spheres.
        """
        p, q = np.broadcast_arrays(
            *(np.atleast_2d(np.asarray(ends, np.float64)) for ends in (points, targets))
        )
        if not len(p):
            return np.zeros(0, bool)
        guard = SHADOW_START * max(self.extent, np.abs(p).max(), np.abs(q).max())
        length = np.linalg.norm(q - p, axis=1)
        apart = length > 2 * guard
        d = np.where(apart[:, None], q - p, [1.0, 0.0, 0.0])
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        ray = self.rays(p + guard * d, d, np.where(apart, length - 2 * guard, 0))
        blocked = self.scene.ray_intersect_preliminary(ray).is_valid().numpy()
        return ~(blocked & apart)

    def camera_rays(self) -> tuple[np.ndarray, np.ndarray]:
        """Origins and directions (h w n n, 3) of the sensor, float64 holding single precision numbers.

        In the order row, column, then row and column within the pixel, at the model's `pixel_offset`.
        """
        view, n = self.view, self.view.samples
        v, u, b, a = (
            index.ravel() for index in np.indices((view.height, view.width, n, n), dtype=np.float64)
        )
        place = [(u + (a + 0.5) / n) / view.width, (v + (b + 0.5) / n) / view.height]
        mi = mitsuba()
        film = mi.Point2f(_columns(mi, np.stack(place, axis=1)))
        ray, _ = self.sensor.sample_ray(0.0, 0.5, film, mi.Point2f(0.5))
        return ray.o.numpy().T.astype(np.float64), ray.d.numpy().T.astype(np.float64)

    def depth_buffer(self) -> np.ndarray:
        """(h, w) distances from the canvas along the ray of each pixel by Mitsuba's integrator `depth`, -1
        on a miss; one ray a pixel, whatever `supersample` is."""
        mi = mitsuba()
        sensor = self.sensor if self.view.samples == 1 else sensor_plugin(mi, self.first_view)
        integrator = mi.load_dict({"type": "depth"})
        picture = mi.render(self.scene, sensor=sensor, integrator=integrator, spp=1)
        depth = picture.numpy()[:, :, 0].astype(np.float64)
        if self.view.samples == 1 and (depth == 0).any():  # a miss, or something that the canvas touches
            hits = self.intersect(*self.camera_rays())
            there = np.where(hits.valid, hits.t, 0).reshape(depth.shape)
            depth = np.where(depth == 0, there, depth)
        return np.where(depth == 0, -1.0, depth)


def build(
    scene: Scene, supersample: int = 1, canvas: Canvas | None = None, reach: float = 1.0
) -> MitsubaScene:
    """The scene in Mitsuba; `canvas` replaces the camera's own, such as a scaled one; `reach`: by how much
    the disks that stand for planes are larger than usual.

    Raises `MachineError` without Mitsuba, `SceneError` where a file cannot be used, `UsageError` for a kind
    of shape without adapter.
    """
    mi = mitsuba()
    scene.check()
    canvas = canvas or exact_canvas(scene)
    meshes = placed_meshes(scene)
    extent = extent_of(scene, canvas, meshes)
    around = Surroundings(scene, meshes, extent, reach)
    bodies = {number: body_of(number, shape, around) for number, shape in enumerate(scene.shapes)}
    tree = {"type": "scene", "embree_use_robust_intersections": True}
    tree |= {
        f"shape{number}": shape_plugin(mi, f"shape{number}", body)
        for number, body in bodies.items()
        if not isinstance(body, Triangles) or len(body.corners)
    }
    # Unoptimized: Mitsuba merges meshes otherwise, and their numbers with them.
    built = mi.load_dict(tree, optimize=False)
    numbers = np.array([int(shape.id().removeprefix("shape")) for shape in built.shapes()], np.int64)
    view, first = (sensor_of(scene.camera, canvas, extent, n) for n in (supersample, 1))
    return MitsubaScene(
        scene=built,
        numbers=numbers,
        sensor=sensor_plugin(mi, view),
        extent=extent,
        view=view,
        first_view=first,
        shape_of=_shape_table(built, numbers),
        primitives={n: body.numbers for n, body in bodies.items() if isinstance(body, Triangles)},
    )


def exact_canvas(scene: Scene) -> Canvas:
    """The canvas of a scene by closed forms: an error of the tracer's own pose is not repeated here."""
    camera, (width, height) = scene.camera, scene.camera.resolution
    center, x, y, forward, pixel_size = (extended.double(value) for value in extended.frame(camera))
    return Canvas(
        center=center,
        x=x,
        y=y,
        forward=forward,
        distance=camera.eye_distance,
        width=width,
        height=height,
        pixel_size=float(pixel_size),
        offset=extended.pixel_offset(camera, scene.literal),
    )


def _shape_table(built: Any, numbers: np.ndarray) -> np.ndarray:
    """Our shape number by the number that Mitsuba gave each shape; 0 stands for no shape."""
    given = _pointers(built.shapes_dr())
    table = np.full(int(given.max(initial=0)) + 1, -1, np.int64)
    table[given] = numbers
    return table


def _no_hits() -> Hits:
    ids, vectors = np.zeros(0, np.int64), np.zeros((0, 3))
    return Hits(np.zeros(0), ids, ids, vectors, vectors, np.zeros(0, bool))


def _pointers(shapes: Any) -> np.ndarray:
    """The numbers that Mitsuba gave to shapes (n,)."""
    import drjit as dr

    numbers: Any = dr.reinterpret_array(mitsuba().UInt32, shapes)
    return np.asarray(numbers.numpy(), np.int64)


def _columns(mi: Any, values: ArrayLike) -> list[Any]:
    """The columns of (n, k) as mi.Float, rounded to single precision."""
    return [mi.Float(np.ascontiguousarray(column, np.float32)) for column in np.asarray(values).T]
