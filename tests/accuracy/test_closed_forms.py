"""Single hits against closed forms in exact rational arithmetic or extended precision: t, position,
normal."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import tracer
from reference import plain
from reference.tolerances import EPSILON, TOLERANCES
from tests.accuracy.probe import directions, unit
from tests.accuracy.worlds import icosphere

Array = np.ndarray
RAYS = 20_000


def scene_of(kind: str, rng: np.random.Generator, scale: float) -> dict[str, Any]:
    """One shape, its numbers exact in single precision, so that both precisions see the same."""
    center = np.float32(rng.uniform(-2, 2, 3) * scale).tolist()
    if kind == "sphere":
        return {"kind": "sphere", "center": center, "radius": float(np.float32(scale))}
    if kind == "plane":
        axis = [0.0, 0.0, 0.0]
        axis[int(rng.integers(3))] = 1.0
        return {"kind": "plane", "coefficients": [*axis, float(np.float32(rng.uniform(-2, 2) * scale))]}
    vertices, faces = icosphere(1)
    placed = np.float32(vertices * scale + center)
    return {"kind": "mesh", "vertices": placed.tolist(), "faces": faces.tolist()}


def exact_t(shape: dict[str, Any], hits: tracer.Hits, o: Array, d: Array, k: int) -> tuple[float, Array]:
    """t and the unit normal of ray k with the surface that was hit, from rational numbers (root in 80
    bits)."""
    fo, fd = ([Fraction(float(x)) for x in v[k]] for v in (o, d))
    length = np.sqrt(np.longdouble(float(sum(x * x for x in fd))))
    if shape["kind"] == "sphere":
        oc = [a - Fraction(b) for a, b in zip(fo, shape["center"], strict=True)]
        a, b = sum(x * x for x in fd), sum(x * y for x, y in zip(oc, fd, strict=True))
        c = sum(x * x for x in oc) - Fraction(shape["radius"]) ** 2
        root = np.sqrt(np.longdouble(float(b * b - a * c)))
        t = (np.longdouble(float(-b)) + (-root if c > 0 else root)) / np.longdouble(float(a))
        p = [float(x) + float(t) * float(y) for x, y in zip(oc, fd, strict=True)]
        return float(t * length), unit(np.array(p))
    if shape["kind"] == "plane":
        n, offset = [Fraction(x) for x in shape["coefficients"][:3]], Fraction(shape["coefficients"][3])
    else:
        a, b, c = ([Fraction(x) for x in shape["vertices"][v]] for v in shape["faces"][hits.primitive[k]])
        u, v = [x - y for x, y in zip(b, a, strict=True)], [x - y for x, y in zip(c, a, strict=True)]
        n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
        offset = -sum(x * y for x, y in zip(n, a, strict=True))
    t = -(sum(x * y for x, y in zip(n, fo, strict=True)) + offset) / sum(
        x * y for x, y in zip(n, fd, strict=True)
    )
    return float(np.longdouble(float(t)) * length), unit(np.array([float(x) for x in n]))


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("kind", ["sphere", "plane", "mesh"])
def test_distance_position_and_normal(kind: str, precision: str) -> None:
    """|dt cos|, |dp.n| <= 16 eps S; normals within 16 eps S / (r cos)."""
    for trial in range(6):
        rng = np.random.default_rng(trial)
        scale = 10 ** rng.uniform(-3, 3)
        shape = scene_of(kind, rng, scale)
        o = np.float32(rng.uniform(-6, 6, (300, 3)) * scale).astype(float)
        d = np.array(shape.get("center", [0, 0, 0])) + scale * directions(rng, 300) - o
        if kind == "mesh":
            d = np.array(shape["vertices"]).mean(0) + 0.9 * scale * directions(rng, 300) - o
        d = np.float32(unit(d)).astype(float)
        hits = tracer.intersect(tracer.load({"shapes": [shape]}), o, d, precision=precision)
        extent = max(
            np.abs(o).max(), np.abs(np.array(shape.get("vertices", shape.get("center", 0)))).max() + scale
        )
        unit_of_error = EPSILON[precision] * extent
        for k in np.flatnonzero(hits.valid)[:60]:
            t, n = exact_t(shape, hits, o, d, int(k))
            cosine = abs(n @ unit(d[k]))
            if cosine < 0.02:
                continue
            p = o[k] + t * unit(d[k])
            errors = {
                "distance": abs(hits.t[k] - t) * cosine / unit_of_error,
                "position": abs((hits.position[k] - p) @ n) / unit_of_error,
                "normal": np.abs(hits.normal[k] - n).max() * scale * cosine / unit_of_error,
            }
            for name, error in errors.items():
                assert error <= TOLERANCES[name].value, (
                    f"{name} of ray {o[k].tolist()} + t {d[k].tolist()}: {error} eps S; "
                    f"t = {hits.t[k]}, exact {t}; normal {hits.normal[k]}, exact {n}"
                )


def test_hits_agree_with_plain() -> None:
    rng = np.random.default_rng(3)
    vertices, faces = icosphere(1)
    table = {
        "shapes": [
            {"kind": "sphere", "center": [1.3, 0.2, 0.4], "radius": 1.1},
            {"kind": "plane", "coefficients": [0.1, 1.0, 0.2, 1.9]},
            {"kind": "mesh", "vertices": (vertices - 1.1).tolist(), "faces": faces.tolist()},
        ]
    }
    o, d = rng.uniform(-4, 4, (600, 3)), directions(rng, 600)
    hits = tracer.intersect(tracer.load(table), o, d)
    world = plain.load(table)
    for k in range(len(o)):
        hit = plain.intersect(world, o[k], d[k])
        mine = (int(hits.shape[k]), int(hits.primitive[k]))
        assert mine == ((-1, -1) if hit is None else (hit.shape, hit.primitive)), (
            f"ray {o[k]} {d[k]}: {mine}, {hit}"
        )
        if hit is not None:
            cosine = abs(np.array(hit.normal) @ d[k])
            extent = max(5.0, hit.t)  # the directions are normalized on either side, and differ by an ulp
            assert (
                abs(hits.t[k] - hit.t) * cosine <= TOLERANCES["distance"].value * EPSILON["double"] * extent
            )


def test_a_light_on_a_sphere_is_seen_from_outside() -> None:
    """Nothing lies strictly between a floor and a light that lies on the near side of a ball."""
    rng = np.random.default_rng(2)
    lit = []
    for _ in range(12):
        n = directions(rng, 1)[0]
        n = unit(n * [1, 0, 1] - [0, 1.5, 0])
        ball = {"kind": "sphere", "center": [0.0, 3.0, 0.0], "radius": 1.3, "color": "#ff0000"}
        light = {"kind": "point", "position": (np.array([0, 3.0, 0]) + 1.3 * n).tolist()}
        camera = {
            "resolution": [8, 8],
            "position": [0.1, 1.5, 0.2],
            "rotate": [0.0, -90.0],
            "pixel_size": 0.01,
        }
        floor = {"kind": "plane", "coefficients": [0, 1, 0, 0]}
        table = {"ambient": 0.0, "camera": camera, "lights": [light], "shapes": [floor, ball]}
        color = tracer.render(tracer.load(table)).color
        lit.append(color[..., 0] > 0)
    assert np.mean(lit) == 1.0, f"only {np.mean(lit):.0%} of the floor's pixels see the light"
