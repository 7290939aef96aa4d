"""Every range of the model is enforced, with a sentence that names key, finding and allowance."""

from __future__ import annotations

import math
from typing import Any

import pytest

from tracer.errors import SceneError
from tracer.scene import Camera, Material, PointLight, Scene, Sphere, load

POINT: dict[str, Any] = {"kind": "point", "position": [0, 0, 0]}
AREA: dict[str, Any] = {"center": [0, 0, 0]}
SPHERE: dict[str, Any] = {"kind": "sphere", "center": [0, 0, 0], "radius": 1}
MESH: dict[str, Any] = {"kind": "mesh", "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}
LOOK_AT: dict[str, Any] = {"origin": [0, 0, 5], "target": [0, 0, 0], "fov": 40}


def _light(**keys: Any) -> dict[str, Any]:
    return {"lights": [keys]}


def _shape(**keys: Any) -> dict[str, Any]:
    return {"shapes": [keys]}


def _texture(**keys: Any) -> dict[str, Any]:
    return {"textures": {"t": keys}}


def _camera(**keys: Any) -> dict[str, Any]:
    return {"camera": keys}


REFUSED = [
    # top level
    ({"version": 2}, "`version` is 2; allowed: 1"),
    ({"version": True}, "`version` is true; allowed: a whole number"),
    ({"ambient": -0.1}, "`ambient` is -0.1; allowed: at least 0"),
    ({"ambient": 1.1}, "`ambient` is 1.1; allowed: at most 1"),
    ({"ambient": math.nan}, "`ambient` is nan; allowed: a finite number"),
    ({"ambient": "0.2"}, '`ambient` is "0.2"; allowed: a number'),
    ({"ambient": True}, "`ambient` is true; allowed: a number"),
    ({"cutoff": 0.0009}, "`cutoff` is 0.0009; allowed: at least 0.001"),
    ({"cutoff": 1.01}, "`cutoff` is 1.01; allowed: at most 1"),
    ({"max_depth": -1}, "`max_depth` is -1; allowed: at least 0"),
    ({"max_depth": 1025}, "`max_depth` is 1025; allowed: at most 1024"),
    ({"max_depth": 3.0}, "`max_depth` is 3.0; allowed: a whole number"),
    ({"max_depth": True}, "`max_depth` is true; allowed: a whole number"),
    ({"seed": -1}, "`seed` is -1; allowed: at least 0"),
    ({"literal": 1}, "`literal` is 1; allowed: true or false"),
    ({"tir": "keep"}, '`tir` is "keep"; allowed: "drop" or "reflect"'),
    ({"diffuse_term": "phong"}, '`diffuse_term` is "phong"; allowed: "lambert" or "reflection"'),
    ({"color_space": "srgb"}, '`color_space` is "srgb"; allowed: "display" or "linear"'),
    ({"background": "#12345"}, '`background` is "#12345"; allowed: "#rrggbb", "#rgb" or [r, g, b]'),
    ({"background": "red"}, '`background` is "red"; allowed: "#rrggbb"'),
    ({"background": [0, 0, 1.5]}, "`background.2` is 1.5; allowed: at most 1"),
    ({"background": [0, 0]}, "`background` is [0, 0]; allowed: "),
    ({"ambiant": 0.2}, "`ambiant` is unknown; the nearest known key is `ambient`"),
    ({"shapes": {}}, "`shapes` is a table; allowed: a list"),
    ({"camera": []}, "`camera` is []; allowed: a table"),
    # materials
    ({"materials": {"glass": {"ior": 0}}}, "`materials.glass.ior` is 0; allowed: greater than 0"),
    (
        {"materials": {"glass": {"reflection": -0.1}}},
        "`materials.glass.reflection` is -0.1; allowed: at least 0",
    ),
    (
        {"materials": {"glass": {"refraction": -0.1}}},
        "`materials.glass.refraction` is -0.1; allowed: at least 0",
    ),
    ({"materials": {"glass": {"diffuse": -1}}}, "`materials.glass.diffuse` is -1; allowed: at least 0"),
    ({"materials": {"glass": {"specular": -1}}}, "`materials.glass.specular` is -1; allowed: at least 0"),
    ({"materials": {"glass": {"shininess": -1}}}, "`materials.glass.shininess` is -1; allowed: at least 0"),
    (
        {"materials": {"my glass": {"reflection": 0.6, "refraction": 0.5}}},
        '`materials."my glass".reflection` 0.6 and `refraction` 0.5 add up to more than 1',
    ),
    (
        {"materials": {"glass": {"iro": 1}}},
        "`materials.glass.iro` is unknown; the nearest known key is `ior`",
    ),
    # lights
    (_light(**POINT, weight=-1), "`lights.0.weight` is -1; allowed: at least 0"),
    (_light(**POINT, weight=0), "`lights` have weights that are all 0; allowed: at least one weight greater"),
    (_light(kind="point"), "`lights.0.position` is missing"),
    (
        _light(kind="spot"),
        '`lights.0.kind` is "spot"; allowed: "point", "ring", "disk", "sphere", "rectangle"',
    ),
    (
        _light(**AREA, kind="ring", normal=[0, 0, 0], radius=1),
        r"`lights.0.normal` is [0, 0, 0]; allowed: a direct",
    ),
    (
        _light(**AREA, kind="disk", normal=[0, 1, 0], radius=0),
        "`lights.0.radius` is 0; allowed: greater than 0",
    ),
    (_light(**AREA, kind="sphere", radius=-1), "`lights.0.radius` is -1; allowed: greater than 0"),
    (_light(**AREA, kind="sphere", radius=1, samples=0), "`lights.0.samples` is 0; allowed: at least 1"),
    (_light(**AREA, kind="sphere", radius=1, jitter=1), "`lights.0.jitter` is 1; allowed: true or false"),
    (
        _light(**AREA, kind="rectangle", normal=[0, 1, 0], size=[1, 0]),
        "`lights.0.size.1` is 0; allowed: greater than 0",
    ),
    # textures
    (_texture(kind="chekcer"), '`textures.t.kind` is "chekcer"; allowed: '),
    (_texture(), '`textures.t.kind` is missing; allowed: "solid", "stripes"'),
    (
        _texture(kind="stripes", colors=["#fff"], interval=1),
        "`textures.t.colors` has 1 entry; allowed: at least 2",
    ),
    (
        _texture(kind="stripes", colors=["#fff", "#000"], interval=0),
        "`textures.t.interval` is 0; allowed: greater",
    ),
    (_texture(kind="checker", colors=["#fff"], interval=1), "`textures.t.colors` has 1 entry; allowed: 2"),
    (_texture(kind="image", file="a.gif"), '`textures.t.file` is "a.gif"; allowed: a file that ends in .png'),
    (
        _texture(kind="image", file="a.png", direction="zx"),
        '`textures.t.direction` is "zx"; allowed: "xy", "yz"',
    ),
    (
        _texture(kind="affine_image", file="a.png", matrix=[[1, 0, 0]]),
        "`textures.t.matrix` has 1 entry; allowed: 2",
    ),
    # shapes
    (_shape(**{**SPHERE, "radius": 0}), "`shapes.0.radius` is 0; allowed: greater than 0"),
    (_shape(**{**SPHERE, "radius": "1"}), '`shapes.0.radius` is "1"; allowed: a number'),
    (_shape(**{**SPHERE, "center": [0, 0]}), "`shapes.0.center` has 2 entries; allowed: 3"),
    (
        _shape(**{**SPHERE, "center": [0, 0, math.inf]}),
        "`shapes.0.center.2` is inf; allowed: a finite number",
    ),
    (_shape(**{**SPHERE, "center": [0, 0, 1e19]}), r"`shapes.0.center.2` is 1e+19; allowed: at most 1e+18"),
    (
        _shape(**SPHERE, name="green ball", radus=2),
        '`shapes."green ball".radus` is unknown; the nearest known key',
    ),
    (_shape(**SPHERE, scale=[1, 2, 3]), "`shapes.0.scale` is [1, 2, 3]; allowed: a number"),
    (_shape(**SPHERE, scale=0), "`shapes.0.scale` is 0; allowed: greater than 0"),
    (_shape(**SPHERE, rotate=[0, 0]), "`shapes.0.rotate` has 2 entries; allowed: 3"),
    (
        _shape(**SPHERE, texture_space="local"),
        '`shapes.0.texture_space` is "local"; allowed: "world" or "object"',
    ),
    (
        _shape(**SPHERE, texture="t", color="#fff"),
        "`shapes.0.texture` and `color` are both given; allowed: one",
    ),
    (_shape(kind="plane"), "`shapes.0` needs `coefficients`, or `point`, `u` and `v`"),
    (_shape(kind="plane", coefficients=[0, 0, 0, 1]), "`shapes.0.coefficients` begins with a zero normal"),
    (
        _shape(kind="plane", coefficients=[0, 1, 0, 0], point=[0, 0, 0]),
        "`shapes.0.coefficients` and `point` are both given",
    ),
    (
        _shape(kind="plane", point=[0, 0, 0], u=[1, 2, 3], v=[-2, -4, -6]),
        "`shapes.0.v` is parallel to `u`; allowed: two directions that span a plane",
    ),
    (
        _shape(kind="plane", point=[0, 0, 0], u=[0, 0, 0], v=[1, 0, 0]),
        "`shapes.0.u` is [0, 0, 0]; allowed: a direc",
    ),
    (_shape(kind="mesh"), "`shapes.0` needs one of `file`, `vertices` with `faces`, or `builtin`"),
    (_shape(kind="mesh", file=""), '`shapes.0.file` is ""; allowed: a string that is not empty'),
    (
        {"textures": {"": {"kind": "solid", "color": "#fff"}}},
        '`textures.""` is ""; allowed: a string that is not empty',
    ),
    ({"materials": {"a" * 201: {}}}, f"`materials.{'a' * 201}` has 201 characters; allowed: at most 200"),
    (_shape(kind="mesh", file=5), "`shapes.0.file` is 5; allowed: a string"),
    (_shape(**SPHERE, name="a" * 201), f"`shapes.{'a' * 201}.name` has 201 characters; allowed: at most 200"),
    (_shape(kind="mesh", builtin="cone"), '`shapes.0.builtin` is "cone"; allowed: "cube" or "tetrahedron"'),
    (_shape(kind="mesh", builtin="cube", file="a.obj"), "`shapes.0.file` and `builtin` are both given"),
    (
        _shape(kind="mesh", builtin="cube", scale=[1, 0, 1]),
        "`shapes.0.scale.1` is 0; allowed: greater than 0",
    ),
    (
        _shape(kind="mesh", file="a.off"),
        '`shapes.0.file` is "a.off"; allowed: a file that ends in .obj, .ply, .stl, .gltf or .glb',
    ),
    (_shape(**{**MESH, "faces": []}), "`shapes.0.faces` has 0 entries; allowed: at least 1"),
    (_shape(**{**MESH, "faces": [[0, 1]]}), "`shapes.0.faces.0` has 2 entries; allowed: at least 3"),
    (
        _shape(**{**MESH, "faces": [[0, 1, 2], [0, 1, 3]]}),
        "`shapes.0.faces.1` names vertex 3; allowed: 0 to 2",
    ),
    (_shape(**{**MESH, "faces": [[0, 1, -1]]}), "`shapes.0.faces.0.2` is -1; allowed: at least 0"),
    (
        _shape(kind="mesh", faces=[[0, 1, 2]]),
        "`shapes.0.vertices` is missing; allowed: `vertices` together with",
    ),
    (
        _shape(kind="mesh", vertices=MESH["vertices"]),
        "`shapes.0.faces` is missing; allowed: `vertices` together",
    ),
    (
        _shape(**SPHERE, material="glas") | {"materials": {"glass": {}}},
        '`shapes.0.material` is "glas", which is no',
    ),
    (
        _shape(**SPHERE, texture="x"),
        '`shapes.0.texture` is "x", which is no texture of this scene; there is no',
    ),
    (_shape(kind="instance", of="x"), '`shapes.0.of` is "x", which is no mesh of this scene'),
    (
        {"shapes": [SPHERE | {"name": "a"}, SPHERE | {"name": "a"}]},
        '`shapes.a.name` is "a", the name of `shapes.0`',
    ),
    (
        {"lights": [POINT | {"name": "a"}, POINT | {"name": "a"}]},
        '`lights.a.name` is "a", the name of `lights.0`',
    ),
    # camera
    (_camera(resolution=[0, 10]), "`camera.resolution.0` is 0; allowed: at least 1"),
    (_camera(resolution=[10, 10**9]), "`camera.resolution.1` is 1000000000; allowed: at most 65535"),
    (
        _camera(resolution=[65535, 65535]),
        "`camera.resolution` is 65535 × 65535, 4294836225 pixels; allowed: at most",
    ),
    (_camera(resolution=[640.0, 480]), "`camera.resolution.0` is 640.0; allowed: a whole number"),
    (_camera(distance=0), "`camera.distance` is 0; allowed: greater than 0"),
    (_camera(pixel_size=0), "`camera.pixel_size` is 0; allowed: greater than 0"),
    (_camera(supersample=0), "`camera.supersample` is 0; allowed: at least 1"),
    (_camera(supersample=65), "`camera.supersample` is 65; allowed: at most 64"),
    (_camera(pixel_offset=1.5), "`camera.pixel_offset` is 1.5; allowed: at most 1"),
    (_camera(**LOOK_AT | {"fov": 0}), "`camera.fov` is 0; allowed: greater than 0"),
    (_camera(**LOOK_AT | {"fov": 180}), "`camera.fov` is 180; allowed: less than 180"),
    (_camera(**LOOK_AT | {"target": [0, 0, 5]}), "`camera.target` is the same point as `origin`"),
    (_camera(**LOOK_AT, up=[0, 0, 0]), "`camera.up` is [0, 0, 0]; allowed: a direction"),
    (_camera(**LOOK_AT, up=[0, 0, -3]), "`camera.up` is parallel to the view from `origin` to `target`"),
    (_camera(**LOOK_AT, up=[0, 1e-9, 3]), "`camera.up` is parallel to the view from `origin` to `target`"),
    (
        _camera(**LOOK_AT, pixel_size=1),
        "`camera.pixel_size` belongs to the canvas form and `origin` to the look-at",
    ),
    (_camera(**LOOK_AT, rotate=[0, 0]), "`camera.rotate` belongs to the canvas form"),
    (_camera(**LOOK_AT, position=[0, 0, 0]), "`camera.position` belongs to the canvas form"),
    (_camera(fov=40), "`camera.origin` is missing; the look-at form (here by `fov`) needs it"),
    (
        _camera(depth_of_field={"focus": 0}),
        "`camera.depth_of_field.focus` is 0; allowed: a positive distance",
    ),
    (_camera(depth_of_field={}), "`camera.depth_of_field.focus` is missing"),
    (
        _camera(depth_of_field={"focus": 9, "depth_range": 0}),
        "`camera.depth_of_field.depth_range` is 0; allowed: gr",
    ),
    (
        _camera(depth_of_field={"focus": 9, "samples": 0}),
        "`camera.depth_of_field.samples` is 0; allowed: at least",
    ),
]


@pytest.mark.parametrize(("data", "words"), REFUSED, ids=[words.split(";")[0] for _, words in REFUSED])
def test_refused(data: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError) as caught:
        load(data)
    assert str(caught.value).startswith(f"scene: {words}")
    assert "\n" not in str(caught.value)


TAKEN = [
    {"ambient": 0, "cutoff": 0.001, "max_depth": 0},
    {"ambient": 1, "cutoff": 1, "max_depth": 1024},
    {"materials": {"m": {"reflection": 0.7, "refraction": 0.3 + 5e-10, "shininess": 0}}},
    _camera(resolution=[8192, 8192]),
    _camera(resolution=[65535, 1]),
    _camera(**LOOK_AT, distance=2),
    _camera(depth_of_field={"focus": -1}),
    {"lights": [POINT | {"weight": 0}, POINT]},
    _shape(kind="plane", point=[0, 0, 0], u=[1e-9, 0, 0], v=[0, 1e9, 0]),
    _shape(kind="plane", coefficients=[0, 1e-300, 0, 0]),
    _shape(**{**MESH, "faces": [[0, 1, 1]]}),
]


@pytest.mark.parametrize("data", TAKEN, ids=str)
def test_limits_themselves_are_allowed(data: dict[str, Any]) -> None:
    assert isinstance(load(data), Scene)


def test_number_of_further_errors_is_told() -> None:
    with pytest.raises(SceneError, match=r"`ambient` is 2; allowed: at most 1 \(and 2 more errors\)$"):
        load({"ambient": 2, "cutoff": 2, "tir": 2})


def test_records_made_in_code_raise_the_same_error() -> None:
    with pytest.raises(SceneError, match=r"^Sphere: `radius` is 0; allowed: greater than 0$"):
        Sphere(center=(0, 0, 0), radius=0)
    with pytest.raises(SceneError, match=r"^Scene: `shapes\.0\.radius` is 0; allowed: greater than 0$"):
        Scene(shapes=[{"kind": "sphere", "center": [0, 0, 0], "radius": 0}])


def test_refused_assignment_changes_nothing() -> None:
    material = Material(reflection=0.5)
    with pytest.raises(SceneError, match="add up to more than 1"):
        material.refraction = 0.6
    assert material == Material(reflection=0.5)
    with pytest.raises(SceneError, match="`refractoin` is unknown; the nearest known key is `refraction`"):
        material.refractoin = 0.1  # type: ignore[attr-defined]
    camera = Camera(**LOOK_AT)
    with pytest.raises(SceneError, match="belongs to the canvas form"):
        camera.pixel_size = 2.0
    assert camera == Camera(**LOOK_AT)
    assert camera.is_look_at
    assert camera.eye_distance == pytest.approx(5e-3, rel=1e-15)


def test_numpy_values_are_taken() -> None:
    np = pytest.importorskip("numpy")
    sphere = Sphere(center=np.arange(3), radius=np.float32(2.5))
    assert sphere == Sphere(center=(0, 1, 2), radius=2.5)
    assert type(sphere.center[0]) is float


def test_add_checks_references_and_weights() -> None:
    scene = Scene(materials={"glass": Material(ior=1.5)})
    scene.add_shape(Sphere(name="ball", center=(0, 0, 0), radius=1, material="glass"))
    scene.add_light(PointLight(position=(0, 1, 0)))
    scene.add_light({"kind": "disk", "center": [0, 1, 0], "normal": [0, 1, 0], "radius": 2})
    assert [shape.name for shape in scene.shapes] == ["ball"]
    assert [light.kind for light in scene.lights] == ["point", "disk"]
    with pytest.raises(
        SceneError, match=r'`shapes\.1\.material` is "glas", .* nearest known material is `glass`'
    ):
        scene.add_shape(Sphere(center=(0, 0, 0), radius=1, material="glas"))
    with pytest.raises(SceneError, match=r'`shapes\.ball\.name` is "ball", the name of `shapes\.0` already'):
        scene.add_shape(Sphere(name="ball", center=(0, 0, 0), radius=1))
    with pytest.raises(SceneError, match=r"radius` is 0; allowed: greater than 0"):
        scene.add_shape({"kind": "sphere", "center": [0, 0, 0], "radius": 0})
    assert len(scene.shapes) == 1


def test_check_finds_what_was_changed_in_place() -> None:
    scene = Scene(shapes=[Sphere(center=(0, 0, 0), radius=1)])
    scene.shapes[0].material = "glass"
    with pytest.raises(SceneError, match=r'`shapes\.0\.material` is "glass", which is no material'):
        scene.check()
    scene.materials["glass"] = {"ior": 1.5}  # type: ignore[assignment]
    scene.check()
    assert scene.materials["glass"] == Material(ior=1.5)
