"""The geometry of a scene for closed forms: read by `reference.plain`, answered in extended precision.

Nothing here comes from the code of `tracer` that places shapes or tests rays; `tracer.Scene` only gives the
entries of the scene file. What the tracer itself makes of them is compared in `placements.py`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

import tracer
from reference import extended, plain
from reference.comparison.materials import material_of
from reference.extended import Extended

PLANE, SPHERE, MESH = "plane", "sphere", "mesh"


@dataclass(frozen=True)
class Truth:
    """All shapes of a scene. `kind` (m,), `rows` (m, 4): n, d of a plane, center and radius of a sphere;
    `first` (m + 1,): where the triangles of each mesh begin in `corners` (t, 3, 3); `corner_normals`
    (t, 3, 3), zero for flat meshes; `flat` (m,); `usable` (t,): not degenerate; `ior` (m,); `extent`: the
    largest |coordinate| of spheres and meshes; `lights` (k, 3): all samples, without jitter; `first_light`
    (l + 1,): where those of each light begin."""

    kind: np.ndarray
    rows: np.ndarray
    first: np.ndarray
    corners: np.ndarray
    corner_normals: np.ndarray
    flat: np.ndarray
    usable: np.ndarray
    ior: np.ndarray
    extent: float
    lights: np.ndarray
    first_light: np.ndarray

    @staticmethod
    def of(scene: tracer.Scene) -> Truth:
        """The shapes of a scene, instances placed, in double precision."""
        entries = [_geometry_entry(scene, shape) for shape in scene.to_dict().get("shapes", [])]
        lights = scene.to_dict().get("lights", [])
        loader = plain.Loader({"shapes": entries, "lights": lights}, scene.base_dir)
        geometries = [shape.geometry for shape in loader.shapes()]
        meshes = [g if isinstance(g, plain.Mesh) else None for g in geometries]
        counts = [len(mesh.triangles) if mesh else 0 for mesh in meshes]
        blocks = [_mesh_arrays(mesh) for mesh in meshes if mesh]
        empty = np.zeros((0, 3, 3))
        corners, normals, usable = (
            np.concatenate([b[k] for b in blocks]) if blocks else (empty if k < 2 else np.zeros(0, bool))
            for k in range(3)
        )
        sources = loader.lights()
        points = [light.point(k, 0.0, 0.0) for light in sources for k in range(light.samples)]
        return Truth(
            kind=np.array([type(g).__name__.lower() for g in geometries], dtype="U6"),
            rows=np.array([_row(g) for g in geometries]).reshape(-1, 4),
            first=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
            corners=corners,
            corner_normals=normals,
            flat=np.array([mesh is None or mesh.corner_normals is None for mesh in meshes], bool),
            usable=usable,
            ior=np.array([material_of(scene, k).ior for k in range(len(geometries))]),
            extent=max((float(g.extent) for g in geometries), default=0.0),
            lights=np.array(points).reshape(-1, 3),
            first_light=np.concatenate([[0], np.cumsum([light.samples for light in sources])]).astype(int),
        )

    @cached_property
    def edges(self) -> np.ndarray:
        """(e, 2, 3) ends of the edges of all triangles, each once."""
        if not len(self.corners):
            return np.zeros((0, 2, 3))
        sides = np.concatenate([self.corners[:, [a, b]] for a, b in pairwise((0, 1, 2, 0))])
        first, second = sides[:, 0], sides[:, 1]
        # Lexicographic order of the two ends, so that both directions of an edge are the same row.
        rows, axis = np.arange(len(sides)), np.argmax(first != second, axis=1)
        swap = first[rows, axis] > second[rows, axis]
        sides[swap] = sides[swap][:, ::-1]
        return np.asarray(np.unique(sides.reshape(-1, 6), axis=0).reshape(-1, 2, 3))

    def triangles(self, shape: np.ndarray, primitive: np.ndarray) -> np.ndarray:
        """(n, 3, 3) corners by shape and triangle number."""
        return np.asarray(self.corners[self.first[shape] + primitive])

    def hit(
        self, o: Any, d: Any, shape: np.ndarray, primitive: np.ndarray, left: np.ndarray | None = None
    ) -> tuple[Extended, Extended]:
        """t (n,) along unit d, and the outward normal (n, 3), where rays meet the given primitives. Of both
        roots of a sphere the first positive one; the far one where the ray leaves that sphere (`left`: the
        shapes that rays leave)."""
        t, normal = extended.number(np.full(len(shape), np.nan)), extended.number(np.zeros((len(shape), 3)))
        o, d = extended.number(o), extended.number(d)
        for kind in (PLANE, SPHERE, MESH):
            k = np.flatnonzero(self.kind[shape] == kind)
            if not len(k):
                continue
            if kind == PLANE:
                t[k], normal[k] = extended.plane_hit(o[k], d[k], self.rows[shape[k]])
            elif kind == MESH:
                t[k], normal[k] = extended.triangle_hit(o[k], d[k], self.triangles(shape[k], primitive[k]))
            else:
                near, far, _ = extended.sphere_roots(o[k], d[k], self.rows[shape[k]])
                takes_far = near <= 0
                if left is not None:
                    takes_far = takes_far | (left[k] == shape[k])
                t[k] = np.where(takes_far, far, near)
                center = extended.number(self.rows[shape[k], :3])
                normal[k] = extended.unit(o[k] + t[k][:, None] * d[k] - center)
        return t, normal

    def outward(self, p: Any, shape: np.ndarray, primitive: np.ndarray) -> Extended:
        """(n, 3) outward geometric normals at points of the given primitives."""
        normal = extended.number(np.zeros((len(shape), 3)))
        for kind in (PLANE, SPHERE, MESH):
            k = np.flatnonzero(self.kind[shape] == kind)
            if kind == PLANE:
                normal[k] = extended.unit(self.rows[shape[k], :3])
            elif kind == SPHERE:
                normal[k] = extended.unit(extended.number(p)[k] - extended.number(self.rows[shape[k], :3]))
            elif len(k):
                corners = self.triangles(shape[k], primitive[k])
                normal[k] = extended.triangle_hit(p[k], p[k], corners)[1]
        return normal

    def shading(
        self, p: Any, d: Any, shape: np.ndarray, primitive: np.ndarray
    ) -> tuple[Extended, np.ndarray, np.ndarray]:
        """Shading normals (n, 3) that face rays of direction d, masks of rays that enter, and |cosine| of the
        interpolated normal (1 for flat shapes): near 0 rounding decides whether it counts."""
        outward = self.outward(p, shape, primitive)
        entering = np.asarray(extended.dot(outward, d) < 0)
        facing = np.where(entering[:, None], outward, -outward)
        cosine = np.ones(len(shape))
        k = np.flatnonzero(~self.flat[shape])
        if len(k):
            weights = extended.barycentrics(extended.number(p)[k], self.triangles(shape[k], primitive[k]))
            normals = extended.number(self.corner_normals[self.first[shape[k]] + primitive[k]])
            mixed = extended.unit((weights[..., None] * normals).sum(axis=1))
            mixed = np.where(entering[k, None], mixed, -mixed)
            c = extended.dot(mixed, extended.number(d)[k])
            facing[k] = np.where((c < 0)[:, None], mixed, facing[k])
            cosine[k] = np.abs(extended.double(c))
        return facing, entering, cosine

    def nearest(
        self, o: Any, d: Any, left: tuple[np.ndarray, np.ndarray] | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Shape and primitive (-1: miss) and t (infinite) of the nearest hits of a few rays, every primitive
        asked; `left`: shapes and primitives that the rays leave, -1 where none, whose start is no hit."""
        d = extended.unit(d)
        best, shape = np.full(len(o), np.inf), np.full(len(o), -1)
        primitive = np.full(len(o), -1)
        for t, number, which in self.crossings(o, d, left):
            closer = np.isfinite(t) & (t > 0) & (t < best)
            best = np.where(closer, t, best)
            shape, primitive = np.where(closer, number, shape), np.where(closer, which, primitive)
        return shape, primitive, best

    def crossings(
        self, o: Any, d: Any, left: tuple[np.ndarray, np.ndarray] | None = None
    ) -> list[tuple[np.ndarray, int, np.ndarray]]:
        """(t, shape, primitive) for every surface: two of a sphere, the nearest positive one of a mesh; t is
        NaN where it is not met, and where it is left there. For a few rays: all triangles are asked."""
        found = []
        none = np.full(len(o), -1)
        leaves, triangle = (none, none) if left is None else left
        for number, kind in enumerate(self.kind):
            zeros = np.zeros(len(o), np.int64)
            shape, here = np.full(len(o), number), leaves == number
            if kind == PLANE:
                t = extended.double(self.hit(o, d, shape, zeros)[0])
                found.append((np.where(here, np.nan, t), number, zeros))
            elif kind == SPHERE:
                near, far, chord = extended.sphere_roots(o, d, self.rows[shape])
                near, far = (np.where(chord >= 0, extended.double(t), np.nan) for t in (near, far))
                starts_near = np.abs(near) <= np.abs(far)
                found.append((np.where(here & starts_near, np.nan, near), number, zeros))
                found.append((np.where(here & ~starts_near, np.nan, far), number, zeros))
            else:
                found.append(self._mesh_crossing(o, d, number, np.where(here, triangle, -1)))
        return found

    def _mesh_crossing(
        self, o: Any, d: Any, number: int, left: np.ndarray
    ) -> tuple[np.ndarray, int, np.ndarray]:
        corners = self.corners[self.first[number] : self.first[number + 1]]
        usable = self.usable[self.first[number] : self.first[number + 1]]
        t, primitive = np.full(len(o), np.nan), np.zeros(len(o), np.int64)
        for k in range(len(o)):
            origin, way = (extended.number(np.broadcast_to(v[k], (len(corners), 3))) for v in (o, d))
            with np.errstate(invalid="ignore", divide="ignore"):
                there, _ = extended.triangle_hit(origin, way, corners)
                met = extended.inside_triangle(origin + there[:, None] * way, corners)
            met &= usable & (np.arange(len(corners)) != left[k])
            there = np.where(met & (extended.double(there) > 0), extended.double(there), np.inf)
            primitive[k] = int(np.argmin(there))
            t[k] = there[primitive[k]] if np.isfinite(there[primitive[k]]) else np.nan
        return t, number, primitive


def _geometry_entry(scene: tracer.Scene, entry: dict[str, Any]) -> dict[str, Any]:
    """The entry of a shape without its looks, its file where it lies."""
    looks = ("texture", "color", "material", "texture_space")
    kept = {key: value for key, value in entry.items() if key not in looks}
    return kept | {"file": str(scene.resolve(kept["file"]))} if "file" in kept else kept


def _row(geometry: plain.Geometry) -> list[float]:
    if isinstance(geometry, plain.Plane):
        return [*geometry.normal, geometry.d]
    return [*geometry.center, geometry.radius] if isinstance(geometry, plain.Sphere) else [0.0] * 4


def _mesh_arrays(mesh: plain.Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners, corner normals, and which triangles are not degenerate."""
    corners = np.array(mesh.vertices)[np.array(mesh.triangles)]
    normals = np.zeros_like(corners) if mesh.corner_normals is None else np.array(mesh.corner_normals)
    return corners, normals, np.array([any(n) for n in mesh.normals])
