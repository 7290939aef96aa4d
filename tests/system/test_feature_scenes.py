"""The small scenes, one a feature: what their opening comments state in closed form, and that none is
missing."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import cv2
import drjit as dr
import numpy as np
import pytest

import tracer
from tracer.assets import ASSETS, builtin_scenes
from tracer.color import decode_srgb, encode_srgb
from tracer.lights import LIGHT_KINDS, PointLight
from tracer.records import Record
from tracer.scene import AffineImage, Checker, Image, Mesh, Stripes
from tracer.scene.toml_files import read_toml
from tracer.scene_warnings import finite_extents, warnings_of
from tracer.shapes import SHAPE_KINDS
from tracer.shapes.triangles import read_mesh
from tracer.textures import TEXTURE_KINDS


def wanted(properties: Mapping[str, Any], owner: str) -> Iterator[str]:
    """The keys of one table of the schema, and the values of those that are one of a few words or a flag."""
    for key, schema in properties.items():
        yield f"{owner}.{key}"
        for form in (schema, *schema.get("anyOf", ())):
            for value in form.get("enum", (True, False) if form.get("type") == "boolean" else ()):
                yield f"{owner}.{key} = {value}"


def shown(record: Record) -> Iterator[str]:
    """The same of a record and those below it: keys that are stated, values that hold, by default too."""
    owner = type(record).__name__
    for key in type(record).model_fields:
        value = getattr(record, key)
        if key in record.model_fields_set:
            yield f"{owner}.{key}"
        if isinstance(value, (str, bool)):
            yield f"{owner}.{key} = {value}"
        entries = value.values() if isinstance(value, dict) else value if isinstance(value, list) else [value]
        for entry in entries:
            if isinstance(entry, Record):
                yield from shown(entry)


def test_every_key_and_every_choice_has_a_scene() -> None:
    """Walks the whole schema: each key of each kind is stated in a scene, each of its choices is shown."""
    schema = tracer.json_schema()
    tables = {"Scene": schema, **schema["$defs"]}
    missing = {name for owner, table in tables.items() for name in wanted(table["properties"], owner)}
    assert {"Scene.base", "Camera.up", "Plane.u", "Checker.index = truncate", "Mesh.smooth = True"} < missing
    for name, file in builtin_scenes().items():
        missing -= {*shown(tracer.load(name)), *(f"Scene.{key}" for key in read_toml(file, name))}
    assert sorted(missing) == []


def test_every_kind_has_a_scene() -> None:
    """Walks the registries: a new kind needs a scene that shows it."""
    scenes = [tracer.load(name) for name in builtin_scenes()]
    assert {shape.kind for scene in scenes for shape in scene.shapes} == set(SHAPE_KINDS)
    assert {light.kind for scene in scenes for light in scene.lights} == set(LIGHT_KINDS)
    assert {texture.kind for scene in scenes for texture in scene.textures.values()} == set(TEXTURE_KINDS)
    assert {scene.camera.is_look_at for scene in scenes} == {True, False}


@pytest.mark.parametrize("name", [name for name in builtin_scenes() if "_" in name])
def test_renders(name: str) -> None:
    """Finite colors, no warnings, and something to see."""
    scene = tracer.load(name)
    result = tracer.render(scene, scale=0.2, supersample=1)
    assert warnings_of(scene) == []
    assert np.isfinite(result.color).all() and (result.depth > 0).any()


def test_sphere_outline() -> None:
    """The outline is a circle of angular radius asin(1/5): it covers pi (tan(asin(1/5)) / tan(15 deg))^2 / 4
    of the square of the picture's height."""
    result = tracer.render(tracer.load("shape_sphere"), supersample=4)
    height = result.alpha.shape[0]
    radius = math.tan(math.asin(1 / 5)) / math.tan(math.radians(15)) * height / 2
    # The sum of coverages misses the area by the outline's length times the grid's step, at most.
    assert result.alpha.sum() == pytest.approx(math.pi * radius**2, abs=2 * math.pi * radius / 4)
    assert np.min(result.depth[result.depth > 0]) + 5e-3 == pytest.approx(4, abs=1e-4)


def test_horizon_of_the_plane() -> None:
    """A ray that falls by the angle a hits 2/sin(a) from the eye; above the horizon there is nothing."""
    scene = tracer.load("shape_plane")
    result = tracer.render(scene, precision="double", supersample=1)
    rows, columns = result.depth.shape
    assert (result.depth[: rows // 2] == -1).all()
    step = 2 * math.tan(math.radians(20)) / rows  # of the canvas at distance 1
    y, x = (np.arange(rows) + 0.5 - rows / 2) * step, (np.arange(columns) + 0.5 - columns / 2) * step
    sine = y[:, None] / np.sqrt(1 + y[:, None] ** 2 + x**2)
    canvas = 7e-3 * np.sqrt(1 + y[:, None] ** 2 + x**2)
    below = slice(rows // 2, None)
    np.testing.assert_allclose(result.depth[below], (2 / sine - canvas)[below], rtol=1e-10)


def test_furnace_is_exactly_white() -> None:
    """White surfaces in ambient light 1 under a white sky: 1 everywhere, but for the weighing of sub-rays."""
    color = tracer.render(tracer.load("optics_furnace")).color
    assert np.abs(color - 1).max() <= 4 * 2.0**-24


def test_middle_of_the_mirror_ball() -> None:
    """The ray along the axis comes straight back and meets the yellow ball behind the eye."""
    scene = tracer.load("optics_mirror")
    path = tracer.trace_path(scene, [[0, 1.2, 6]], [[0, 0, -1]], "RR")
    np.testing.assert_allclose(path.position[0, 0], [0, 1.2, 1.2], atol=1e-12)
    np.testing.assert_allclose(path.direction[0, 0], [0, 0, 1], atol=1e-12)
    assert [scene.shapes[number].name for number in path.shape[0]] == ["ball", "yellow ball"]
    np.testing.assert_allclose(path.position[0, 1], [0, 1.2, 9 - math.sqrt(2**2 - 0.8**2)], rtol=1e-12)


def test_mirror_box_ends_by_depth() -> None:
    """Perfect mirrors never lose weight: every path that meets no ball and no floor ends by the cap of 16."""
    scene = tracer.load("optics_mirror_box")
    stats = tracer.render(scene, supersample=1).stats
    assert stats["deepest_level"] == 16
    assert stats["ended_by_depth"] > 0 and stats["ended_by_cutoff"] == 0
    path = tracer.trace_path(scene, [[0.0, 3.0, 3.0]], [[0.0, 0.6, -0.8]], "R" * 16)
    np.testing.assert_allclose(path.position[0, :, 2], [-2, 4] * 8, atol=1e-12)
    # A rise of 0.6 for every 0.8 of the way between the mirrors: 9 for the 12 of a pair.
    np.testing.assert_allclose(path.position[0, 2:, 1] - path.position[0, :-2, 1], 9, rtol=1e-12)


def test_window_of_total_reflection() -> None:
    """Rays steeper than asin(1/1.333) from the vertical leave the water, all others are mirrored."""
    scene = tracer.load("optics_total_reflection")
    angles = np.radians(np.concatenate([np.linspace(0, 48.5, 50), np.linspace(48.7, 89, 50)]))
    d = np.stack([np.sin(angles), np.cos(angles), np.zeros_like(angles)], axis=1)
    path = tracer.trace_path(scene, np.tile([0.0, -3.0, 0.0], (100, 1)), d, "T")
    total = np.isnan(path.direction[:, 0, 0])
    assert not total[:50].any() and total[50:].all()
    out = path.direction[:50, 0]
    np.testing.assert_allclose(out[:, 0], 1.333 * np.sin(angles[:50]), atol=1e-14)


def test_the_window_is_a_circle_in_the_picture() -> None:
    """Along the middle column and row the sky's color ends at tan(48.6)/tan(55) of half the height."""
    name = "optics_total_reflection"
    blue, black = (
        tracer.render(tracer.load(name, overrides={"background": color}), supersample=1).color
        for color in ("#90c0f0", "#000000")
    )
    radius = math.tan(math.asin(1 / 1.333)) / math.tan(math.radians(55)) * 120
    assert 2 * radius / 240 == pytest.approx(0.794, abs=5e-4)
    seen = (blue != black).any(axis=2)
    column, row = np.flatnonzero(seen[:, 160]), np.flatnonzero(seen[120])
    assert (column[0], column[-1]) == pytest.approx((119.5 - radius, 119.5 + radius), abs=1)
    assert (row[0], row[-1]) == pytest.approx((159.5 - radius, 159.5 + radius), abs=1)


def test_ring_gives_25_visibilities() -> None:
    """24 samples of one weight: below the light the floor's brightness takes steps of 1/24."""
    scene = tracer.load("light_ring")
    assert len(scene.lights) == 1
    result = tracer.render(scene, supersample=1, precision="double")
    darkest = result.color[result.depth > 0][:, 0].min()
    assert darkest == pytest.approx(0.3 * 0xC0 / 255, rel=1e-12)  # the ball's shade: the ambient share


@pytest.mark.parametrize(
    ("name", "places"),
    [
        ("option_transparent_shadows", [((-0.9, 0.9, 0.0), 0.7**2), ((1.0, 0.9, 0.0), 0.7)]),
        ("optics_glass", [((0.0, 1.0, 0.0), 0.95**2)]),
    ],
)
def test_light_through_glass(name: str, places: list[tuple[tuple[float, float, float], float]]) -> None:
    """Straight through the middle of a ball k_t^2 of the light reaches the floor, through the pane k_t."""
    scene = tracer.load(name)
    assert isinstance(scene.lights[0], PointLight)
    light = np.array(scene.lights[0].position)
    for inside, share in places:
        floor = light + (inside - light) * light[1] / (light[1] - inside[1])
        straight = light - floor
        cosine = straight[1] / np.linalg.norm(straight)
        expected = 0.2 + 0.8 * share * cosine
        # The floor itself, seen from above the spot by a camera that looks down from below the glass.
        view = tracer.load(
            scene.to_dict()
            | {
                "camera": {
                    "resolution": [1, 1],
                    "origin": [floor[0], 0.1, floor[2]],
                    "target": floor.tolist(),
                    "up": [0, 0, 1],
                    "fov": 0.01,
                }
            }
        )
        color = tracer.render(view, precision="double").color[0, 0, 0]
        assert color / (0xD8 / 255) == pytest.approx(expected, rel=1e-6)


def test_linear_ambient_share() -> None:
    """In the shade the floor is encode(0.2 decode(color))."""
    scene = tracer.load("option_linear")
    for light in scene.lights:
        assert isinstance(light, PointLight)
        light.position = (4.0, -6.0, 5.0)
    color = tracer.render(scene, supersample=1, precision="double").color[-1, 0]
    floor = np.array([0xD8, 0xD4, 0xC8]) / 255
    np.testing.assert_allclose(color, encode_srgb(0.2 * decode_srgb(floor)), rtol=1e-12)


def test_literal_cells_around_zero_are_twice_as_wide() -> None:
    """Rounding towards zero puts -40 < x < 40 into one cell."""
    result = tracer.render(tracer.load("option_literal"))
    row = result.color[60, :, 0] > 0.5
    x = np.arange(320) - 160.0
    changes = np.abs((x * 1.5)[1:][row[1:] != row[:-1]])  # the wall is half as far again as the canvas
    expected = [40, 40, 80, 80, 120, 120, 160, 160, 200, 200]
    np.testing.assert_allclose(np.sort(changes[changes < 230]), expected, atol=2)


def test_height_and_belly_of_the_teapot() -> None:
    """3.15 high, 0.01 above the table; at 0.9 the belly reaches 2 from the axis, at 1.8 the handle 3."""
    scene = tracer.load("shape_teapot")
    o = np.array([[0, 9, 0], [0, 0.91, 9], [-9, 1.81, 0], [0, 0.005, 9]])
    d = [[0, -1, 0], [0, 0, -1], [1, 0, 0], [0, 0, -1]]
    hits = tracer.intersect(scene, o, d)
    np.testing.assert_allclose(hits.t[:3], [9 - 3.16, 9 - 2, 9 - 3], rtol=1e-6)
    names = [scene.shapes[number].name for number in hits.shape]
    assert names == ["teapot"] * 3 + ["wall"], "the last ray passes between pot and table"


def test_the_teapot_has_only_its_six_open_rims(repository: Path) -> None:
    """Body, lid, both ends of handle and spout; every other edge belongs to two triangles, turned alike."""
    mesh = tracer.load("shape_teapot").shapes[1]
    assert isinstance(mesh, Mesh)
    faces = read_mesh(mesh, repository / "assets" / "teapot.obj", "teapot").triangles
    edges = {(face[i], face[i - 2]) for face in faces.tolist() for i in range(3)}
    assert len(edges) == 3 * len(faces) == 3 * 4032
    follower = {a: b for a, b in edges if (b, a) not in edges}
    rims = 0
    while follower:
        start, point = follower.popitem()
        while point != start:
            point = follower.pop(point)
        rims += 1
    assert rims == 6


def picture_of(texture: Image | AffineImage) -> np.ndarray:
    """The colors (h, w, 3) of a picture texture's file; rows count upwards, with `flip_v` downwards."""
    pixels = cv2.imread(str(ASSETS / Path(texture.file).name))
    assert pixels is not None
    return (pixels if texture.flip_v else pixels[::-1])[:, :, ::-1] / 255


def cell_colors(texture: Any, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The colors of a texture on z = 0 by its definition, and where that is clear of a cell's border."""
    if isinstance(texture, Stripes):
        q = np.stack([(x + y) / texture.interval])
    elif isinstance(texture, Checker):
        q = np.stack([x, y]) / texture.interval
    else:
        q = np.stack([x, y]) * (texture.matrix[0][0] if isinstance(texture, AffineImage) else 1)
    cells = (np.floor(q) if texture.index == "floor" else np.abs(np.trunc(q))).astype(int)
    if isinstance(texture, (Stripes, Checker)):
        colors = np.array(texture.colors)[cells.sum(axis=0) % len(texture.colors)]
    else:
        colors = picture_of(texture)[cells[1] % 640, cells[0] % 640]
    return colors, (np.abs(q - np.round(q)) > 1e-3).all(axis=0)


def test_cells_down_and_towards_zero() -> None:
    """Every panel shows its texture as counted from its own middle."""
    scene = tracer.load("texture_index")
    result = tracer.render(scene, supersample=1, precision="double", aovs=("shape", "position"))
    for number, shape in enumerate(scene.shapes):
        seen = result.aovs["shape"] == number
        x, y = (result.aovs["position"][seen][:, axis] - shape.translate[axis] for axis in (0, 1))
        assert np.ptp(x) > 200 and np.ptp(y) > 310, "the whole panel is in view"
        colors, clear = cell_colors(scene.textures[str(shape.texture)], x, y)
        np.testing.assert_allclose(result.color[seen][clear], colors[clear], rtol=1e-12)
        assert clear.mean() > 0.85


def test_pictures_along_three_directions() -> None:
    """(u, v) = (x - 100, y - 50) on the back wall, (y, z) on the left wall, (x, z) on the floor."""
    scene = tracer.load("texture_direction", overrides={"ambient": 1.0})
    result = tracer.render(scene, scale=0.5, supersample=1, precision="double", aovs=("shape", "position"))
    x, y, z = np.moveaxis(result.aovs["position"], 2, 0)
    places = {"floor": (x, z), "back wall": (x - 100, y - 50), "left wall": (y, z)}
    for number, shape in enumerate(scene.shapes):
        seen = result.aovs["shape"] == number
        assert seen.sum() > 1000
        texture = scene.textures[str(shape.texture)]
        assert isinstance(texture, Image)
        picture = picture_of(texture)
        u, v = (coordinate[seen] - 0.5 for coordinate in places[str(shape.name)])
        column, row = (np.floor(c).astype(int) for c in (u, v))
        expected = np.zeros((len(u), 3))
        for i, j in np.ndindex(2, 2):
            weight = np.abs(1 - i - (u - column)) * np.abs(1 - j - (v - row))
            expected += weight[:, None] * picture[(row + j) % len(picture), (column + i) % len(picture)]
        np.testing.assert_allclose(result.color[seen], expected, atol=1e-9)


def test_light_of_five_kinds_adds_up() -> None:
    """The light's terms are linear in its color: the picture is the sum of those with one light each."""
    scene = tracer.load("light_colors")
    whole = tracer.render(scene, scale=0.25, supersample=1, precision="double").color
    total = np.zeros_like(whole)
    for light in scene.lights:
        black = {f'lights."{other.name}".color': "#000000" for other in scene.lights if other is not light}
        one = tracer.load("light_colors", overrides=black)
        part = tracer.render(one, scale=0.25, supersample=1, precision="double").color
        assert part.max() > 0.03
        total += part
    np.testing.assert_allclose(total, whole, atol=1e-12)


def test_scene_on_a_base() -> None:
    """What the new scene does not name is the base's; its cube stands 0.01 above the floor."""
    base, scene = tracer.load("option_linear"), tracer.load("option_base")
    assert (scene.camera, scene.lights, scene.materials) == (base.camera, base.lights, base.materials)
    assert (scene.color_space, scene.diffuse_term) == ("linear", "reflection")
    assert [shape.name for shape in scene.shapes] == ["floor", "cube"]
    corners, _ = finite_extents(scene)[1]
    assert corners[:, 1].min() == pytest.approx(0.01, abs=1e-6)


@pytest.mark.parametrize("width", [1, 7, 1000])
@pytest.mark.parametrize("precision", ["single", "double"])
def test_queries_of_every_width(width: int, precision: str) -> None:
    """The answer of a ray does not depend on how many others are asked."""
    scene = tracer.load("shape_mesh")
    rng = np.random.default_rng(7)
    o = rng.uniform(-3, 3, (1000, 3)) + [0, 3, 4]
    d = rng.normal(size=(1000, 3))
    whole = tracer.intersect(scene, o, d, precision=precision)
    part = tracer.intersect(scene, o[:width], d[:width], precision=precision)
    for name in ("t", "shape", "primitive", "normal", "position"):
        np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[:width])
    path = tracer.trace_path(scene, o[:width], d[:width], "RR", precision=precision)
    assert path.position.shape == (width, 2, 3)


@pytest.mark.slow
def test_debug_mode_finds_no_access_out_of_bounds() -> None:
    """Dr.Jit's Debug flag checks every gather and scatter; a picture of meshes, textures and area lights."""
    with dr.scoped_set_flag(dr.JitFlag.Debug):
        checked = tracer.render(tracer.load("classic_rabbit"), scale=0.05, supersample=1)
    plain = tracer.render(tracer.load("classic_rabbit"), scale=0.05, supersample=1)
    np.testing.assert_allclose(checked.color, plain.color, atol=1e-5)
