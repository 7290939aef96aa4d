"""Small seeded scenes for the comparison of `tracer` with `reference.plain`: one a feature, and random ones.

Every scene is a dict as in a scene file. Coordinates are odd numbers on purpose: pixel centers must not
fall on edges by symmetry, where either answer is right. Files stand in one folder, made by `write_files`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

Table = dict[str, Any]

RESOLUTION = (32, 24)

GLASS = {"ior": 1.5, "reflection": 0.2, "refraction": 0.7, "specular": 0.6, "diffuse": 0.4, "shininess": 30.0}
MIRROR = {"reflection": 0.8, "diffuse": 0.5, "specular": 0.5, "shininess": 10.0}
MATERIALS = {
    "glass": GLASS,
    "mirror": MIRROR,
    "heavy": {"ior": 2.4, "reflection": 0.1, "refraction": 0.85, "specular": 1.0, "shininess": 90.0},
    "air": {"ior": 1.0, "refraction": 0.9},
    "glossy": {"reflection": 0.15, "diffuse": 0.9, "specular": 0.6, "shininess": 50.0},
    "flat": {"diffuse": 0.7, "specular": 0.3, "shininess": 0.0},
}
POINT_LIGHTS = [
    {"kind": "point", "position": [-6.1, 12.3, 8.2], "weight": 2.0},
    {"kind": "point", "position": [7.4, 9.1, 3.3], "weight": 1.0, "color": [1.0, 0.8, 0.6]},
]


def write_files(folder: Path) -> Path:
    """The pictures and meshes that the scenes name."""
    rng = np.random.default_rng(5)
    cv2.imwrite(str(folder / "tile.png"), rng.integers(0, 256, (5, 7, 3), np.uint8))
    cv2.imwrite(str(folder / "deep.png"), rng.integers(0, 65536, (4, 3), np.uint16))
    vertices, faces = icosphere(1)
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    (folder / "ico.obj").write_text("\n".join(lines) + "\n")
    normals = [f"vn {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices + np.array([0.1, 0.05, -0.08])]
    with_normals = [f"f {a + 1}//{a + 1} {b + 1}//{b + 1} {c + 1}//{c + 1}" for a, b, c in faces]
    (folder / "ico_normals.obj").write_text("\n".join(lines[: len(vertices)] + normals + with_normals) + "\n")
    return folder


def icosphere(subdivisions: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) on the unit sphere and triangles (m, 3), counterclockwise from outside."""
    phi = (1 + math.sqrt(5)) / 2
    corners = [(-1, phi, 0), (1, phi, 0), (-1, -phi, 0), (1, -phi, 0), (0, -1, phi), (0, 1, phi)]
    corners += [(0, -1, -phi), (0, 1, -phi), (phi, 0, -1), (phi, 0, 1), (-phi, 0, -1), (-phi, 0, 1)]
    vertices = [np.array(c) / math.hypot(1, phi) for c in corners]
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4)]
    faces += [(11, 10, 2), (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9)]
    faces += [(4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    for _ in range(subdivisions):
        middle: dict[tuple[int, int], int] = {}

        def between(a: int, b: int, middle: dict[tuple[int, int], int] = middle) -> int:
            key = (min(a, b), max(a, b))
            if key not in middle:
                point = vertices[a] + vertices[b]
                vertices.append(point / np.linalg.norm(point))
                middle[key] = len(vertices) - 1
            return middle[key]

        finer = []
        for a, b, c in faces:
            ab, bc, ca = between(a, b), between(b, c), between(c, a)
            finer += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        faces = finer
    return np.array(vertices), np.array(faces)


def room(**changes: Any) -> Table:
    """Three planes, three spheres and a cube, seen by the document's camera."""
    table: Table = {
        "ambient": 0.2,
        "background": [0.1, 0.2, 0.3],
        "camera": {
            "resolution": list(RESOLUTION),
            "distance": 11.3,
            "pixel_size": 0.231,
            "position": [0.13, 2.27, 7.1],
            "rotate": [7.3, -9.1],
        },
        "lights": POINT_LIGHTS,
        "materials": MATERIALS,
        "textures": {
            "tiles": {"kind": "checker", "colors": ["#f2efe6", "#4a5560"], "interval": 1.37},
            "bands": {"kind": "stripes", "colors": ["#e9dfc9", "#c9d3c0", "#dcc6b0"], "interval": 1.13},
        },
        "shapes": [
            {"kind": "plane", "coefficients": [0, 1, 0, 0], "material": "glossy", "texture": "tiles"},
            {"kind": "plane", "coefficients": [0, 0, 2, 10.6], "texture": "bands"},
            {"kind": "sphere", "center": [-2.31, 1.5, -1.7], "radius": 1.5, "material": "mirror"},
            {"kind": "sphere", "center": [0.71, 1.1, 1.2], "radius": 1.1, "material": "glass"},
            {
                "kind": "sphere",
                "center": [2.9, 0.8, 0.1],
                "radius": 0.8,
                "color": "#d9362b",
                "material": "flat",
            },
            cube(
                translate=[3.7, 1.33, -2.9],
                rotate=[12.0, 33.0, 5.0],
                scale=[1.1, 0.9, 1.3],
                material="glossy",
            ),
        ],
    }
    return table | changes


def cube(**keys: Any) -> Table:
    """A cube as an explicit mesh of quads, outward."""
    vertices = [[x, y, z] for z in (-1.0, 1.0) for y in (-1.0, 1.0) for x in (-1.0, 1.0)]
    faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]]
    return {"kind": "mesh", "vertices": vertices, "faces": faces} | keys


def _with_shapes(shapes: list[Table], **changes: Any) -> Table:
    table = room(**changes)
    return table | {"shapes": table["shapes"][:2] + shapes}


def _area(kind: str, jitter: bool) -> Table:
    size = {"size": [2.3, 1.7]} if kind == "rectangle" else {"radius": 1.3}
    normal = {} if kind == "sphere" else {"normal": [0.2, -1.0, -0.3]}
    area = {"kind": kind, "center": [-1.7, 7.9, 3.1], "samples": 7, "weight": 3.0, "jitter": jitter}
    return room(lights=[POINT_LIGHTS[1], area | size | normal], seed=77)


def _textured(texture: Table, **shape: Any) -> Table:
    table = room()
    table["textures"] = table["textures"] | {"own": texture}
    table["shapes"] = [dict(s) for s in table["shapes"]]
    table["shapes"][1] = {"kind": "plane", "coefficients": [0.1, 0.2, 2, 10.6], "texture": "own"}
    table["shapes"][4] |= {"texture": "own"} | shape
    del table["shapes"][4]["color"]
    table["shapes"][5] |= {"texture": "own"} | shape
    return table


def _picture(**keys: Any) -> Table:
    matrix = [[3.1, 0.7, -0.4], [0.3, 2.7, 0.9]]
    return {"kind": "affine_image", "file": "tile.png", "matrix": matrix, "offset": [0.3, -0.7]} | keys


def _camera(**keys: Any) -> Table:
    table = room()
    return table | {"camera": table["camera"] | keys}


def _look_at() -> Table:
    camera = {"resolution": list(RESOLUTION), "origin": [4.1, 5.3, 12.7], "target": [0.1, 1.2, -0.3]}
    return room(camera=camera | {"up": [0.1, 1.0, 0.0], "fov": 41.0})


def _glasses(**changes: Any) -> Table:
    shapes = [
        {"kind": "sphere", "center": [-2.3, 1.61, 0.3], "radius": 1.6, "material": "heavy"},
        cube(translate=[1.9, 1.21, 0.7], rotate=[21.0, 37.0, 11.0], scale=1.2, material="heavy"),
        {"kind": "sphere", "center": [4.1, 2.3, -2.1], "radius": 1.1, "material": "mirror"},
    ]
    return _with_shapes(shapes, **changes)


def _meshes(smooth: bool, file: str, **keys: Any) -> Table:
    mesh = {"kind": "mesh", "name": "ball", "file": file, "smooth": smooth, "material": "glossy"}
    shapes = [
        mesh | {"translate": [-1.9, 1.7, 0.4], "rotate": [10.0, 20.0, 30.0], "scale": [1.5, 1.2, 1.7]} | keys,
        {"kind": "instance", "of": "ball", "translate": [2.3, 1.5, 0.9], "scale": 1.3, "color": "#70ff70"},
        {"kind": "instance", "of": "ball", "translate": [1.1, 4.5, -1.9], "scale": 0.9, "material": "mirror"},
    ]
    return _with_shapes(shapes)


def _ugly_mesh() -> Table:
    """Glass letters L: concave, with a corner on a straight edge, among triangles without area; all faces
    twice, the quads also wound the other way round."""
    outline = [[0, 0], [2, 0], [2, 0.5], [0.5, 0.5], [0.5, 3], [0.25, 3], [0, 3]]
    n = len(outline)
    vertices = [[x, y, z] for z in (0.0, 0.7) for x, y in outline]
    sides = [[k, (k + 1) % n, n + (k + 1) % n, n + k] for k in range(n)]
    faces = [[0, 1, 1], list(range(n))[::-1], list(range(n, 2 * n)), *sides, [4, 5, 6]]
    faces = [*faces, *faces, *[[a, d, c, b] for a, b, c, d in sides]]
    letter = {"kind": "mesh", "name": "letter", "vertices": vertices, "faces": faces, "material": "glass"}
    shapes = [
        letter | {"translate": [-2.5, 0.4, 0.4], "rotate": [0.0, 20.0, 0.0]},
        {
            "kind": "instance",
            "of": "letter",
            "translate": [1, 0.2, 0.9],
            "smooth": True,
            "material": "mirror",
        },
    ]
    return _with_shapes(shapes) | {"transparent_shadows": True}


def _mirrors() -> Table:
    half = {"reflection": 1.0}
    table = room(max_depth=9, materials=MATERIALS | {"full": half})
    table["shapes"] = [
        {"kind": "plane", "coefficients": [1, 0.1, 0, 4.1], "material": "full"},
        {"kind": "plane", "coefficients": [-1, 0.07, 0.05, 4.3], "material": "full"},
        *table["shapes"],
    ]
    return table


def _many_spheres() -> Table:
    rng = np.random.default_rng(11)
    shapes = [
        {
            "kind": "sphere",
            "center": rng.uniform((-4, 0.3, -3), (4, 5, 3)).round(3).tolist(),
            "radius": round(float(rng.uniform(0.2, 0.6)), 3),
            "material": ["mirror", "glass", "flat", "glossy"][k % 4],
            "color": rng.uniform(0.3, 1, 3).round(3).tolist(),
        }
        for k in range(40)
    ]
    return _with_shapes(shapes)


def _placed() -> Table:
    return room(
        shapes=[
            {
                "kind": "plane",
                "coefficients": [0, 1, 0, 0.5],
                "rotate": [3.0, 0.0, 2.0],
                "translate": [0, 0.5, 0],
                "scale": 2.0,
                "texture": "tiles",
                "texture_space": "object",
            },
            {"kind": "plane", "point": [0, 0, -5.3], "u": [2, 0, 0.3], "v": [0, 3, 0.2], "texture": "bands"},
            {
                "kind": "sphere",
                "center": [1, 0.5, 0.2],
                "radius": 0.7,
                "scale": 1.9,
                "rotate": [20.0, 40.0, -15.0],
                "translate": [-0.7, 0.9, 0.3],
                "texture": "tiles",
                "texture_space": "object",
                "material": "glossy",
            },
            cube(
                translate=[-3.1, 1.4, 0.2],
                rotate=[15.0, 25.0, 35.0],
                scale=[1.1, 0.9, 1.2],
                texture="bands",
                texture_space="object",
                material="glass",
                name="block",
            ),
            {"kind": "instance", "of": "block", "translate": [3.3, 1.5, -0.9], "rotate": [5.0, -25.0, 10.0]},
        ]
    )


def _lamps(count: int) -> Table:
    """Point lights in a spiral above the room, of different weights and colors."""
    lamps = []
    for k in range(count):
        angle = 0.37 + 2.4 * k
        position = [3.1 * np.cos(angle), 5.3 + 0.06 * k, 2.2 + 2.7 * np.sin(angle)]
        color = [1.0, 1 - 0.02 * k, 0.3 + 0.02 * k]
        lamps.append({"kind": "point", "position": position, "color": color, "weight": 1.0 + k % 3})
    return room(lights=lamps)


FEATURES: dict[str, Callable[[], Table]] = {
    "room": room,
    "no lights": lambda: room(lights=[]),
    "lights in the kernel": lambda: _lamps(7),
    "lights in a table": lambda: _lamps(33),
    "weight zero": lambda: room(
        lights=[*POINT_LIGHTS, {"kind": "point", "position": [0, 3, 3], "weight": 0.0}]
    ),
    **{
        f"{kind} light": (lambda kind=kind: _area(kind, False))
        for kind in ("ring", "disk", "sphere", "rectangle")
    },
    **{
        f"{kind} jitter": (lambda kind=kind: _area(kind, True))
        for kind in ("ring", "disk", "sphere", "rectangle")
    },
    "light above": lambda: room(
        lights=[
            {"kind": "disk", "center": [0.3, 8.1, 1.9], "normal": [0, -1, 0], "radius": 1.1, "samples": 5}
        ]
    ),
    "glasses": _glasses,
    "transparent shadows": lambda: _glasses(transparent_shadows=True),
    "tir reflect": lambda: _glasses(tir="reflect"),
    "secondary background": lambda: _glasses(secondary_background=True, tir="reflect"),
    "diffuse reflection": lambda: room(diffuse_term="reflection"),
    "linear": lambda: room(color_space="linear"),
    "ambient": lambda: room(ambient=0.0, cutoff=0.3),
    "small cutoff": lambda: _glasses(cutoff=0.004, tir="reflect"),
    "mirrors": _mirrors,
    "many spheres": _many_spheres,
    "many transparent": lambda: _many_spheres() | {"transparent_shadows": True},
    "placed": _placed,
    "flat meshes": lambda: _meshes(False, "ico.obj"),
    "smooth meshes": lambda: _meshes(True, "ico.obj"),
    "file normals": lambda: _meshes(True, "ico_normals.obj"),
    "ugly mesh": _ugly_mesh,
    "smooth glass": lambda: _meshes(True, "ico.obj", material="glass"),
    "truncate": lambda: _textured(
        {"kind": "stripes", "colors": ["#ff0000", "#00ff00", "#2030ff"], "interval": 0.9, "index": "truncate"}
    ),
    "truncate checker": lambda: _textured(
        {"kind": "checker", "colors": ["#ff0000", "#00ff00"], "interval": 0.9, "index": "truncate"}
    ),
    "picture xy": lambda: _textured({"kind": "image", "file": "tile.png", "direction": "xy"}),
    "picture yz": lambda: _textured({"kind": "image", "file": "tile.png", "direction": "yz"}),
    "picture xz": lambda: _textured({"kind": "image", "file": "deep.png", "direction": "xz", "flip_v": True}),
    "affine picture": lambda: _textured(_picture()),
    "affine truncate": lambda: _textured(_picture(index="truncate")),
    "bilinear": lambda: _textured(_picture(filter="bilinear")),
    "bilinear flipped": lambda: _textured(_picture(filter="bilinear", flip_v=True)),
    "bilinear linear": lambda: _textured(_picture(filter="bilinear")) | {"color_space": "linear"},
    "object texture": lambda: _textured(_picture(), texture_space="object"),
    "literal": lambda: _textured(_picture()) | {"literal": True},
    "literal overridden": lambda: _textured(_picture(index="floor", flip_v=False)) | {"literal": True},
    "two by two": lambda: _camera(supersample=2),
    "three by three": lambda: _camera(supersample=3),
    "look at": _look_at,
    "turned": lambda: _camera(rotate=[-31.0, 17.0], position=[2.1, 3.3, 5.9]),
    "depth of field": lambda: _camera(
        depth_of_field={"focus": 17.0, "depth_range": 3.0, "samples": 9, "seed": 4}
    ),
    "depth of field, near": lambda: _camera(depth_of_field={"focus": 4.0, "samples": 30}),
}


def random_scene(seed: int) -> Table:
    """Random shapes, materials, lights and options, all in view."""
    rng = np.random.default_rng(seed)

    def numbers(low: float, high: float, n: int = 3) -> list[float]:
        return rng.uniform(low, high, n).round(3).tolist()

    def pick(*choices: Any) -> Any:
        return choices[rng.integers(len(choices))]

    names = list(MATERIALS)
    shapes: list[Table] = [
        {"kind": "plane", "coefficients": [*numbers(-0.1, 0.1, 1), 1.0, *numbers(-0.1, 0.1, 1), 1.7]},
        {"kind": "plane", "coefficients": [*numbers(-0.2, 0.2, 2), 1.0, 6.9]},
    ]
    shapes += [
        {"kind": "sphere", "center": numbers(-3, 3), "radius": numbers(0.4, 1.4, 1)[0]} for _ in range(4)
    ]
    shapes += [
        cube(translate=numbers(-3, 3), rotate=numbers(0, 360), scale=numbers(0.4, 1.2)) for _ in range(2)
    ]
    for shape in shapes:
        shape["material"] = pick(*names)
        if rng.random() < 0.5:
            shape["color"] = numbers(0.2, 1)
        else:
            shape["texture"] = pick("tiles", "bands", "picture")
            shape["texture_space"] = pick("world", "object")
    table = room(
        shapes=[shapes[k] for k in rng.permutation(len(shapes))],
        ambient=numbers(0, 0.5, 1)[0],
        tir=pick("drop", "reflect"),
        secondary_background=pick(True, False),
        transparent_shadows=pick(True, False),
        diffuse_term=pick("lambert", "reflection"),
        color_space=pick("display", "linear"),
        cutoff=pick(0.05, 0.02, 0.2),
        seed=int(rng.integers(1 << 40)),
    )
    table["textures"] = table["textures"] | {"picture": _picture(filter=pick("nearest", "bilinear"))}
    area = {
        "kind": "sphere",
        "center": numbers(-5, 5),
        "radius": 0.6,
        "samples": 5,
        "jitter": pick(True, False),
    }
    table["lights"] = [{"kind": "point", "position": numbers(-8, 8), "weight": 2.0}, area]
    table["camera"] = table["camera"] | {"position": [0.13, 0.7, 7.1], "rotate": numbers(-9, 9, 2)}
    return table
