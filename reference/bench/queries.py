"""Rays a second by kind: our hierarchy next to Embree, both asked from inside Dr.Jit, in one process.

Both sides get the same rays in the memory of Dr.Jit, and write back what an integrator needs: the distance
and the primitive, or whether something is there. Embree is told which rays are coherent. The time is that of
the kernels, as Dr.Jit's history has it; that of Python, which records them, is not in it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import drjit as dr
import numpy as np

import tracer
from reference.bench.frames import Check
from reference.bench.rays import EYE, KINDS, LIGHT, Rays, primary, secondary
from reference.bench.records import Rate, Series
from tracer.acceleration.traverse import Fold, visit_triangles
from tracer.backends import INVALID, Backend, exact_arithmetic, find_backend
from tracer.device_scene import compile_scene
from tracer.intersection import closest_hit, free_ray
from tracer.queries import intersect
from tracer.ray import Ray, no_hit

Query = Callable[[], Any]
"""Traces all rays of one kind once; the mask of those that hit something."""


def rates_of(
    mesh: str, scene: tracer.Scene, peers: Sequence[str], pixels: int, repeat: int, check: Check
) -> list[Rate]:
    """All kinds of rays on one mesh by tracer and, where it is among the peers, by Mitsuba."""
    rays = _rays(scene, pixels)
    sides: dict[str, Any] = {}
    if "tracer" in peers:
        sides["tracer"] = Ours(scene)
    if "mitsuba" in peers:
        sides["mitsuba"] = Embree(scene)
    found = []
    for kind in KINDS:
        found += _interleaved(mesh, kind, rays[kind], sides, repeat)
        check()
    return found


def _rays(scene: tracer.Scene, pixels: int) -> dict[str, Rays]:
    """Rays by kind; the primary hits that others start from are found in double precision."""
    tiles = primary(pixels, tiles=True)
    hits = intersect(scene, tiles.o, tiles.d, backend="llvm")
    named = dict(zip(KINDS[:2], (primary(pixels, tiles=False), tiles), strict=True))
    return named | secondary(tiles, hits.t, hits.normal)


def _interleaved(mesh: str, kind: str, rays: Rays, sides: dict[str, Any], repeat: int) -> list[Rate]:
    queries: dict[str, Query] = {peer: side.query(rays, kind) for peer, side in sides.items()}
    hits = {peer: int(np.count_nonzero(query().numpy())) for peer, query in queries.items()}
    seconds: dict[str, list[float]] = {peer: [] for peer in queries}
    for _ in range(repeat):
        for peer, query in queries.items():
            seconds[peer].append(kernel_seconds(query))
    return [Rate(mesh, kind, peer, rays.count, hits[peer], Series(tuple(seconds[peer]))) for peer in queries]


def kernel_seconds(query: Query) -> float:
    """How long the kernels of one call run, those between them (to sort out rays) included."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        query()
        dr.sync_thread()
        history = dr.kernel_history()
    return sum(entry["execution_time"] for entry in history) / 1e3


class Ours:
    """The Dr.Jit level of the tracer, in single precision."""

    def __init__(self, scene: tracer.Scene) -> None:
        self._backend: Backend = find_backend("llvm", "single")
        self._device = compile_scene(scene, self._backend)

    def query(self, rays: Rays, kind: str) -> Query:
        """Closest hits, or any hit for shadow rays."""
        backend = self._backend
        o, d = (backend.Vector3(*map(backend.table, a.T)) for a in (rays.o, rays.d))
        active = dr.full(backend.Bool, True, rays.count)
        eye, light = backend.opaque_vector(EYE), backend.opaque_vector(LIGHT)
        dr.eval(o, d, active)

        def closest() -> Any:
            with exact_arithmetic():
                hit = closest_hit(self._device, free_ray(self._device, o, d), active)
                dr.eval(hit)
            return hit.valid

        def coherent() -> Any:
            with exact_arithmetic():
                hit = closest_of_neighbors(self._device, o, d, eye, active)
                dr.eval(hit)
            return hit.valid

        def shadow() -> Any:
            with exact_arithmetic():
                blocked = hidden_neighbors(self._device, o, light)
                dr.eval(blocked)
            return blocked

        if rays.length is not None:
            return shadow
        return coherent if kind.startswith("primary") else closest


def closest_of_neighbors(device: Any, o: Any, d: Any, eye: Any, active: Any) -> Any:
    """Closest hits of rays that start in one eye, as the renderer finds those of its primary rays: in
    bundles."""
    from tracer.acceleration.bundles import RAYS, Found, answers_to, neighboring_points
    from tracer.acceleration.first_of_bundles import Bundles, nearest_of_bundles
    from tracer.first_hits import nearest_among, slot_of_hit
    from tracer.intersection import closest_triangle, known_triangle

    backend = device.backend

    def rays(numbers: Any) -> Ray:
        return free_ray(device, dr.gather(type(o), o, numbers), dr.gather(type(d), d, numbers))

    def in_bundles(bundle: Any, both: bool) -> Found:
        starts = [dr.zeros(backend.Float, dr.width(bundle))] * RAYS
        bundles = Bundles(eye, neighboring_points(backend, d, bundle), starts)
        found = nearest_of_bundles(backend, device.triangles, bundles, both)
        dr.eval(found)
        return found

    def among(found: Found, places: Any, numbers: Any) -> Any:
        answers = nearest_among(device, rays(numbers), found, places)
        dr.eval(answers)
        return answers

    def singly(numbers: Any) -> Any:
        everything = dr.full(backend.Bool, True, len(numbers))
        return slot_of_hit(device, closest_triangle(device, rays(numbers), everything))

    first = answers_to(backend.UInt32, dr.width(d), in_bundles, among, singly)
    nothing = no_hit(backend, dr.width(d))
    return known_triangle(device, free_ray(device, o, d), nothing, active, first)


def hidden_neighbors(device: Any, o: Any, light: Any) -> Any:
    """Mask: some triangle lies between points and a light, as the renderer finds it where primary rays hit:
    in bundles from the light."""
    from tracer.acceleration.bundles import DOUBTFUL, RAYS, Found, answers_to, neighboring_points
    from tracer.acceleration.shadows_of_bundles import HIDDEN, LIT, LitPoints, hidden_points

    backend = device.backend

    def reach(p: Any) -> Any:
        return dr.norm(light - p)

    def in_bundles(bundle: Any, both: bool) -> Found:
        points = neighboring_points(backend, o, bundle)
        nothing_left = [backend.UInt32(INVALID)] * RAYS
        bundles = LitPoints([reach(p) for p in points], lambda: points, lambda: nothing_left)
        found = hidden_points(backend, device.triangles, light, bundles, both)
        dr.eval(found)
        return found

    def blocked(numbers: Any, active: Any, candidates: Fold | None = None) -> Any:
        p = dr.gather(type(o), o, numbers)
        length = reach(p)
        ray = free_ray(device, p, (light - p) / length)
        return dr.select(any_triangle(device, ray, length, active, candidates), backend.UInt32(HIDDEN), LIT)

    def among(found: Found, places: Any, numbers: Any) -> Any:
        asked = dr.gather(type(places), found.answers, places) != DOUBTFUL
        answers = dr.select(asked, blocked(numbers, asked, partial(found.fold, places)), DOUBTFUL)
        dr.eval(answers)
        return answers

    def singly(numbers: Any) -> Any:
        return blocked(numbers, dr.full(backend.Bool, True, dr.width(numbers)))

    return answers_to(backend.UInt32, dr.width(o), in_bundles, among, singly) == HIDDEN


def any_triangle(device: Any, ray: Ray, length: Any, active: Any, among: Fold | None = None) -> Any:
    """Mask: some triangle, of all or `among` some (see `visit_triangles`), is hit before `length`; the walk
    ends with the first."""
    from tracer.leaving import departure

    return visit_triangles(
        device.backend,
        device.triangles,
        ray,
        lambda: departure(device, ray, True),
        state=dr.full(device.backend.Bool, False, dr.width(ray.d)),
        limit=lambda blocked: length,
        visit=lambda blocked, _t, _primitive, _test, valid: blocked | valid,
        active=active,
        done=lambda blocked: blocked,
        among=among,
    )


class Embree:
    """Mitsuba's scene, with robust intersections as in `reference.mitsuba_scene`."""

    def __init__(self, scene: tracer.Scene) -> None:
        from reference.mitsuba_scene import build
        from reference.mitsuba_variant import mitsuba

        self._mi = mitsuba()
        self._scene = build(scene).scene

    def query(self, rays: Rays, kind: str) -> Query:
        """Closest hits, or any hit for shadow rays."""
        mi, scene = self._mi, self._scene
        o, d = (_vector(mi.Vector3f, a) for a in (rays.o, rays.d))
        ray = mi.Ray3f(mi.Point3f(o), d)
        if rays.length is not None:
            ray.maxt = mi.Float(rays.length)
        coherent = kind.startswith("primary")
        dr.eval(ray)

        def closest() -> Any:
            hit = scene.ray_intersect_preliminary(ray, coherent=coherent)
            dr.eval(hit.t, hit.prim_index, hit.shape_index)
            return hit.is_valid()

        def anything() -> Any:
            blocked = scene.ray_test(ray, coherent=coherent)
            dr.eval(blocked)
            return blocked

        return closest if rays.length is None else anything


def _vector(kind: Any, values: np.ndarray) -> Any:
    return kind(*(np.ascontiguousarray(values[:, axis]) for axis in range(3)))
