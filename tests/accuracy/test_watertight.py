"""Rays aimed at edges and corners that triangles share: none passes between them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import tracer
from reference.tolerances import TOLERANCES
from tests.accuracy.probe import directions, rotation, unit
from tests.accuracy.worlds import cube, icosphere

Array = np.ndarray
RAYS = 100_000


def closed_mesh(name: str, rng: np.random.Generator) -> tuple[Array, Array]:
    """Vertices and triangles of a closed mesh that is star-shaped about its middle."""
    if name == "cube":
        block = cube()
        faces = [[q[0], q[k], q[k + 1]] for q in block["faces"] for k in (1, 2)]
        vertices = np.array(block["vertices"])
    else:
        vertices, triangles = icosphere(2)
        faces = triangles.tolist()
        if name == "random":
            vertices = vertices * rng.uniform(0.7, 1.3, (len(vertices), 1))
    placed = vertices @ rotation(rng).T * 10 ** rng.uniform(-2, 2) + rng.uniform(-2, 2, 3)
    return placed.astype(np.float32).astype(np.float64), np.array(faces)


def edges_of(faces: Array) -> tuple[Array, Array]:
    """Vertex pairs (e, 2) and the two triangles (e, 2) at each."""
    owners: dict[tuple[int, int], list[int]] = {}
    for number, face in enumerate(faces):
        for a, b in pairwise([*face, face[0]]):
            owners.setdefault((min(a, b), max(a, b)), []).append(number)
    return np.array(list(owners)), np.array(list(owners.values()))


def aimed(name: str, target: str, seed: int) -> tuple[Array, Array, Array, Array]:
    """Mesh and rays (o, d) at points of edges, or at corners, all of whose faces front the ray."""
    rng = np.random.default_rng(seed)
    vertices, faces = closed_mesh(name, rng)
    normals = unit(
        np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    )
    edges, owners = edges_of(faces)
    k = rng.integers(len(edges), size=2 * RAYS)
    share = rng.uniform(size=(2 * RAYS, 1)) if target == "edge" else np.zeros((2 * RAYS, 1))
    point = (1 - share) * vertices[edges[k, 0]] + share * vertices[edges[k, 1]]
    d = unit(
        -unit(normals[owners[k]].sum(axis=1))
        + 0.9 * rng.uniform(0, 1, (2 * RAYS, 1)) * directions(rng, 2 * RAYS)
    )
    size = np.abs(vertices - vertices.mean(0)).max()
    cosine = -np.einsum("nij,nj->ni", normals[owners[k]], d)
    if target == "corner":
        around = np.zeros((len(vertices), len(faces)), bool)
        around[faces, np.arange(len(faces))[:, None]] = True
        cosine = np.where(around[edges[k, 0]], -(d @ normals.T), 1)
    fronting = cosine.min(axis=1) > TOLERANCES["fronting"].value
    o = (point - size * rng.uniform(3, 6, (2 * RAYS, 1)) * d)[fronting][:RAYS]
    point = point[fronting][:RAYS]
    return vertices, faces, o, point - o


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("target", ["edge", "corner"])
@pytest.mark.parametrize("name", ["cube", "icosphere", "random"])
def test_no_ray_passes_between_triangles(name: str, target: str, precision: str) -> None:
    """A miss, or a hit on the far side of the mesh, is a leak. The distance tells them apart."""
    vertices, faces, o, way = aimed(name, target, seed=len(name))
    scene = tracer.load(
        {"shapes": [{"kind": "mesh", "vertices": vertices.tolist(), "faces": faces.tolist()}]}
    )
    hits = tracer.intersect(scene, o, way, precision=precision)
    assert len(o) > 0.5 * RAYS
    length = np.linalg.norm(way, axis=1)
    passed = ~hits.valid | ((hits.normal * way).sum(axis=1) > 0)
    blocked_before = hits.valid & (hits.t < 0.9 * length)
    leaks = passed & ~blocked_before
    if leaks.any():
        k = int(np.argmax(leaks))
        pytest.fail(
            f"{int(leaks.sum())} of {len(o)}: from {o[k]} along {way[k]}: t = {hits.t[k]}, aimed at "
            f"{length[k]}"
        )
