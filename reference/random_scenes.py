"""Random scenes from a seed: planes, spheres and meshes, mirrors and glass, sizes from 1e-3 to 1e4."""

from __future__ import annotations

from typing import Any

import numpy as np

import tracer

MATERIALS: dict[str, dict[str, float]] = {
    "mirror": {"reflection": 0.8, "diffuse": 0.5},
    "glass": {"ior": 1.5, "reflection": 0.1, "refraction": 0.8, "specular": 0.5, "shininess": 40.0},
    "diamond": {"ior": 2.4, "reflection": 0.1, "refraction": 0.8},
    "bubble": {"ior": 0.75, "refraction": 0.9},
    "matte": {"diffuse": 0.9},
}


RESOLUTION = (192, 144)
"""Columns and rows of a picture."""


def random_scene(seed: int) -> tracer.Scene:
    """Scene number `seed`, named `random-SEED`: 1 to 3 planes, 2 to 8 spheres, 1 to 4 solids around a point
    that lies up to two sizes off the origin, all in view of a turned camera, and two lights."""
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-3, 4)
    middle = rng.uniform(-2, 2, 3) * size
    shapes = [_plane(rng, middle, size) for _ in range(rng.integers(1, 4))]
    shapes += [_sphere(rng, middle, size) for _ in range(rng.integers(2, 9))]
    shapes += [_solid(rng, middle, size) for _ in range(rng.integers(1, 5))]
    order = rng.permutation(len(shapes))
    colors = np.random.default_rng([seed, 1]).uniform(0.35, 1, (len(shapes), 3))
    table = {
        "background": "#101820",
        "camera": _camera(rng, middle, size),
        "lights": [
            {
                "kind": "point",
                "position": (middle + size * rng.uniform(-1.5, 1.5, 3)).tolist(),
                "weight": 2.0,
            },
            {
                "kind": "sphere",
                "center": (middle + size * rng.uniform(-1.5, 1.5, 3)).tolist(),
                "radius": 0.1 * size,
                "samples": 5,
            },
        ],
        "materials": MATERIALS,
        "shapes": [
            shapes[k] | {"name": f"shape {n}", "color": color}
            for (n, k), color in zip(enumerate(order), colors.tolist(), strict=True)
        ],
    }
    return tracer.load(table).come_from(name=f"random-{seed}", label=f"random-{seed}")


def _material(rng: np.random.Generator) -> str:
    return str(rng.choice(list(MATERIALS)))


def _direction(rng: np.random.Generator) -> np.ndarray:
    v = rng.normal(size=3)
    return np.asarray(v / np.linalg.norm(v))


def _plane(rng: np.random.Generator, middle: np.ndarray, size: float) -> dict[str, Any]:
    """A plane 1 to 2 sizes from the middle."""
    normal = _direction(rng)
    d = float(size * rng.uniform(1, 2) - normal @ middle)
    return {"kind": "plane", "coefficients": [*normal.tolist(), d], "material": _material(rng)}


def _sphere(rng: np.random.Generator, middle: np.ndarray, size: float) -> dict[str, Any]:
    return {
        "kind": "sphere",
        "center": (middle + size * rng.uniform(-0.9, 0.9, 3)).tolist(),
        "radius": float(size * 10.0 ** rng.uniform(-1.3, -0.4)),
        "material": _material(rng),
    }


def _solid(rng: np.random.Generator, middle: np.ndarray, size: float) -> dict[str, Any]:
    return {
        "kind": "mesh",
        "builtin": str(rng.choice(["cube", "tetrahedron"])),
        "scale": (size * rng.uniform(0.08, 0.3, 3)).tolist(),
        "rotate": rng.uniform(-180, 180, 3).tolist(),
        "translate": (middle + size * rng.uniform(-0.9, 0.9, 3)).tolist(),
        "material": _material(rng),
    }


def _camera(rng: np.random.Generator, middle: np.ndarray, size: float) -> dict[str, Any]:
    """The look-at form or the document's, each outside the shapes and turned to them."""
    if rng.random() < 0.5:
        eye = middle + 0.95 * size * _direction(rng)
        return {
            "resolution": list(RESOLUTION),
            "origin": eye.tolist(),
            "target": (middle + 0.2 * size * _direction(rng)).tolist(),
            "up": _direction(rng).tolist(),
            "fov": float(rng.uniform(20, 90)),
        }
    angles = rng.uniform(-180, 180, 2)
    return {
        "resolution": list(RESOLUTION),
        "position": (middle + 0.3 * size * _direction(rng)).tolist(),
        "distance": float(size * rng.uniform(0.1, 0.5)),
        "pixel_size": float(size / RESOLUTION[0] * rng.uniform(0.3, 1)),
        "rotate": angles.tolist(),
    }
