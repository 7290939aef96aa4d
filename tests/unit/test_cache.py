"""What is kept: bounded, and never what was true before."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tracer
from tests.accuracy import worlds
from tests.unit.mesh_writers import Gltf
from tracer import device_meshes
from tracer.backends import find_backend
from tracer.cache import Cache, FileCache, Identity, Stamps, bytes_of, forget_everything
from tracer.device_scene import DeviceScene, compile_scene
from tracer.errors import SceneError
from tracer.film.png import write_png
from tracer.scene.contents import contents_of, snapshot
from tracer.shapes import triangles

# ---- Bounds ------------------------------------------------------------------------------------------------


def test_few_entries_stay_those_asked_for_last() -> None:
    cache: Cache[str] = Cache(entries=2, megabytes=1)
    cache.keep("a", "A")
    cache.keep("b", "B")
    assert cache.find("a") == "A"
    cache.keep("c", "C")
    assert [cache.find(key) for key in "abc"] == ["A", None, "C"]
    cache.keep("a", "new")
    assert cache.find("a") == "new" and cache.find("c") == "C"
    cache.forget()
    assert cache.find("a") is None


def test_bytes_are_bounded_but_for_the_newest_entry() -> None:
    cache: Cache[np.ndarray] = Cache(entries=9, megabytes=1)
    for key, kilobytes in (("a", 400), ("b", 400), ("c", 400)):
        cache.keep(key, np.zeros(kilobytes << 10, np.uint8))
    assert [cache.find(key) is None for key in "abc"] == [True, False, False]
    cache.keep("d", np.zeros(5 << 20, np.uint8))
    assert [cache.find(key) is None for key in "bcd"] == [True, True, False]
    cache.keep("e", np.zeros(1, np.uint8))
    assert [cache.find(key) is None for key in "de"] == [True, False]


def test_bytes_of_all_arrays_below_a_record_count() -> None:
    backend = find_backend("llvm", "double")
    vector = backend.Vector3(backend.opaque(1), backend.opaque(2), backend.opaque(3))
    assert bytes_of([np.zeros((2, 5)), {"a": backend.Float([1, 2])}, (vector, "no array", 7, None)]) == 120


def test_identity_tells_equal_objects_apart() -> None:
    one, other = (tuple(map(float, "12")) for _ in range(2))
    assert one is not other and Identity(one) == Identity(one) and Identity(one) != Identity(other)
    assert len({Identity(one), Identity(one), Identity(other)}) == 2


# ---- Files -------------------------------------------------------------------------------------------------

SETTLED = 0.06
"""Seconds after which a later change of a file has another time."""


class Counted:
    """A cache of texts, and how often a file was read."""

    def __init__(self, *others: Path) -> None:
        self.reads, self._others = 0, others
        self._cache: FileCache[str] = FileCache(entries=4, megabytes=1)

    def __call__(self, path: Path) -> str:
        return self._cache.get(path, self._read)

    def _read(self, path: Path) -> tuple[str, tuple[Path, ...]]:
        self.reads += 1
        return "".join(file.read_text() for file in (path, *self._others)), self._others


def test_a_file_that_stays_as_it_is_is_read_once(tmp_path: Path) -> None:
    file, text = tmp_path / "a", Counted()
    file.write_text("one")
    time.sleep(SETTLED)
    assert [text(file) for _ in range(3)] == ["one"] * 3
    assert text.reads == 1


def test_a_file_written_at_once_again_is_read_again(tmp_path: Path) -> None:
    """Within the tick of a clock two contents of one size have the same time."""
    file, text = tmp_path / "a", Counted()
    for number in range(200):
        file.write_text(f"{number:03}")
        assert text(file) == f"{number:03}"


@pytest.mark.parametrize(
    ("written", "age", "settled"),
    [
        (1_700_000_000_123_456_789, 10_000_000, False),
        (1_700_000_000_123_456_789, 60_000_000, True),
        (1_700_000_000_000_000_000, 60_000_000, False),  # perhaps a file system that counts seconds
        (1_700_000_000_000_000_000, 2_100_000_000, True),
    ],
)
def test_a_file_is_trusted_when_its_times_tell_changes_apart(
    written: int, age: int, settled: bool, tmp_path: Path
) -> None:
    file = tmp_path / "a"
    file.write_text("one")
    os.utime(file, ns=(written, written))
    changed = file.stat().st_ctime_ns
    assert Stamps.of([file], changed + age).settled == settled
    assert Stamps.of([tmp_path / "none"], 0).still_true
    assert not Stamps.of([file], changed - 1_000_000_000).settled


def keep_time(file: Path) -> None:
    status = os.stat(file)
    file.write_text("two")
    os.utime(file, ns=(status.st_atime_ns, status.st_mtime_ns))


def replace_file(file: Path) -> None:
    file.with_suffix(".new").write_text("two")
    file.with_suffix(".new").replace(file)


def swap_link(file: Path) -> None:
    file.with_suffix(".other").write_text("two")
    file.unlink()
    file.symlink_to(file.with_suffix(".other"))


@pytest.mark.parametrize("change", [lambda file: file.write_text("two"), keep_time, replace_file, swap_link])
def test_a_change_of_a_file_is_seen(change: Callable[[Path], Any], tmp_path: Path) -> None:
    file, text = tmp_path / "a", Counted()
    file.write_text("one")
    time.sleep(SETTLED)
    assert text(file) == "one"
    change(file)
    assert text(file) == "two"


def test_a_change_of_another_file_that_was_read_is_seen(tmp_path: Path) -> None:
    file, other = tmp_path / "a", tmp_path / "b"
    text = Counted(other)
    file.write_text("one")
    other.write_text("1")
    time.sleep(SETTLED)
    assert [text(file), text(file)] == ["one1", "one1"] and text.reads == 1
    other.write_text("2")
    assert text(file) == "one2"
    other.unlink()
    with pytest.raises(FileNotFoundError):
        text(file)


# ---- Scenes ------------------------------------------------------------------------------------------------

TRIANGLE = "v 0 0 0\nv {x} 0 0\nv 0 1 0\nf 1 2 3\n"


def compiled(scene: tracer.Scene, precision: str = "single") -> DeviceScene:
    return compile_scene(scene, find_backend("llvm", precision))


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """A folder with a mesh and a picture that were written some time ago."""
    (tmp_path / "a.obj").write_text(TRIANGLE.format(x=1))
    write_png(tmp_path / "a.png", np.full((2, 2, 3), 0.25))
    time.sleep(SETTLED)
    return tmp_path


def scene_with(folder: Path, **keys: Any) -> tracer.Scene:
    """A mesh and a plane with a picture, both from files."""
    table: dict[str, Any] = {
        "ambient": 1.0,
        "camera": {"resolution": [8, 8], "origin": [0.3, 0.3, 3], "target": [0.3, 0.3, 0], "fov": 40.0},
        "textures": {"paper": {"kind": "image", "file": "a.png", "direction": "xy"}},
        "materials": {"dull": {}},
        "shapes": [
            {"name": "mesh", "kind": "mesh", "file": "a.obj", "color": "#ff0000", "material": "dull"},
            {"kind": "plane", "coefficients": [0, 0, 1, 1], "texture": "paper"},
        ],
    }
    return tracer.load(table | keys, base_dir=folder)


def test_another_camera_compiles_nothing(files: Path) -> None:
    scene = scene_with(files)
    device = compiled(scene)
    scene.camera.origin = (0.0, 1.0, 4.0)
    assert compiled(scene) is device
    assert compiled(scene_with(files)) is device
    assert compiled(scene, "double") is not device
    assert compiled(scene) is device


def add_light(scene: tracer.Scene) -> None:
    scene.lights.append(tracer.load({"lights": [{"kind": "point", "position": [0, 0, 3]}]}).lights[0])


def add_light_as_a_dict(scene: tracer.Scene) -> None:
    scene.lights.append({"kind": "point", "position": [0, 0, 3]})  # type: ignore[arg-type]


def negative_zero(scene: tracer.Scene) -> None:
    scene.shapes[0].translate = (-0.0, 0.0, 0.0)


CHANGES: dict[str, Callable[[tracer.Scene], Any]] = {
    "a key": lambda scene: setattr(scene, "ambient", 0.5),
    "a key of a record": lambda scene: setattr(scene.shapes[0], "color", "#00ff00"),
    "a key of a named record": lambda scene: setattr(scene.materials["dull"], "ior", 1.5),
    "a record in a list": lambda scene: scene.shapes.pop(),
    "an addition": add_light,
    "an addition that nobody has checked": add_light_as_a_dict,
    "the order": lambda scene: scene.shapes.reverse(),
    "the sign of a zero": negative_zero,
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_of_a_scene_is_seen(change: str, files: Path) -> None:
    """The same bytes as where nothing was kept."""
    scene = scene_with(files)
    before = compiled(scene)
    CHANGES[change](scene)
    assert compiled(scene) is not before
    found = tracer.render(scene, aovs="all", backend="llvm")
    forget_everything()
    fresh = tracer.render(scene, aovs="all", backend="llvm")
    assert found.color.tobytes() == fresh.color.tobytes()
    assert all(found.aovs[name].tobytes() == fresh.aovs[name].tobytes() for name in fresh.aovs)


def test_a_scene_that_became_wrong_is_refused(files: Path) -> None:
    scene = scene_with(files)
    compiled(scene)
    scene.shapes.append("nonsense")  # type: ignore[arg-type]
    with pytest.raises(SceneError, match=r"shapes\.2"):
        compiled(scene)
    scene.shapes.pop()
    scene.materials.clear()
    with pytest.raises(SceneError, match="dull"):
        compiled(scene)


def test_vertices_in_the_scene_are_told_apart() -> None:
    """Large lists by identity, which is that of the record's own tuple."""
    points = np.random.default_rng(1).normal(size=(300, 3))
    shape = {"kind": "mesh", "vertices": points.tolist(), "faces": np.arange(300).reshape(100, 3).tolist()}
    scene = tracer.load({"shapes": [shape]})
    device = compiled(scene)
    assert compiled(scene) is device
    scene.shapes[0].vertices = (2 * points).tolist()  # type: ignore[attr-defined]
    assert compiled(scene).host.extent == pytest.approx(2 * device.host.extent)


def test_the_same_names_in_another_folder_are_other_files(files: Path) -> None:
    other = files / "other"
    other.mkdir()
    (other / "a.obj").write_text(TRIANGLE.format(x=7))
    write_png(other / "a.png", np.full((2, 2, 3), 0.25))
    time.sleep(SETTLED)
    assert compiled(scene_with(files)).host.extent == 1
    assert compiled(scene_with(other)).host.extent == 7


def test_a_file_that_changes_is_read_again(files: Path) -> None:
    scene = scene_with(files)
    first = tracer.render(scene, backend="llvm")
    (files / "a.obj").write_text(TRIANGLE.format(x=7))
    assert compiled(scene).host.extent == 7
    (files / "a.obj").write_text(TRIANGLE.format(x=1))
    write_png(files / "a.png", np.full((2, 2, 3), 0.75))
    second = tracer.render(scene, backend="llvm")
    blank = np.isclose(first.color[..., 2], 64 / 255, atol=0.01)
    assert blank.any() and not blank.all()
    np.testing.assert_allclose(second.color[blank], 191 / 255, atol=0.01)


@pytest.mark.parametrize("name", ["a.obj", "a.png"])
@pytest.mark.parametrize("damage", ["removed", "cut short", "outside"])
def test_a_file_that_can_no_longer_be_used_is_an_error(name: str, damage: str, files: Path) -> None:
    scene = scene_with(files)
    compiled(scene)
    file = files / name
    content = file.read_bytes()
    file.unlink()
    if damage == "cut short":
        file.write_bytes(content[:12])
    elif damage == "outside":
        outside = files.parent / f"outside {name}"
        outside.write_bytes(content)
        file.symlink_to(outside)
    with pytest.raises(SceneError, match=f"{name}"):
        compiled(scene)


def test_a_file_that_takes_the_place_of_an_asset_is_found(tmp_path: Path) -> None:
    scene = tracer.load({"shapes": [{"kind": "mesh", "file": "assets/teapot.obj"}]}, base_dir=tmp_path)
    count = compiled(scene).host.first_primitive[-1]
    (tmp_path / "assets").mkdir()
    (tmp_path / "assets" / "teapot.obj").write_text(TRIANGLE.format(x=1))
    assert count > 1 and compiled(scene).host.first_primitive[-1] == 1


def test_a_file_beside_a_gltf_that_changes_is_read_again(tmp_path: Path) -> None:
    file = Gltf()
    file.mesh(file.primitive([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [0, 1, 2]))
    tree = json.loads(file.json())
    data = bytes(file.data)
    tree["buffers"] = [{"uri": "a.bin", "byteLength": len(data)}]
    (tmp_path / "a.gltf").write_text(json.dumps(tree))
    (tmp_path / "a.bin").write_bytes(data)
    time.sleep(SETTLED)
    scene = tracer.load({"shapes": [{"kind": "mesh", "file": "a.gltf"}]}, base_dir=tmp_path)
    device = compiled(scene)
    assert device.host.extent == 1 and compiled(scene) is device
    (tmp_path / "a.bin").write_bytes(data.replace(np.float32(1).tobytes(), np.float32(5).tobytes()))
    assert compiled(scene).host.extent == 5


def test_what_a_change_does_not_concern_is_not_made_again(
    files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A material: neither the file nor the hierarchy. A place: the hierarchy alone."""
    made: list[str] = []
    for module, name in ((triangles, "read_polygons"), (device_meshes, "build_hierarchy")):
        true = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *a, name=name, true=true: made.append(name) or true(*a))
    scene = scene_with(files)
    compiled(scene)
    assert made == ["read_polygons", "build_hierarchy"]
    scene.materials["dull"].ior = 1.5
    compiled(scene)
    compiled(scene, "double")
    assert made == ["read_polygons", "build_hierarchy", "build_hierarchy"]
    scene.shapes[0].translate = (0.5, 0.0, 0.0)
    compiled(scene)
    assert made == ["read_polygons"] + 3 * ["build_hierarchy"]


# ---- Contents ----------------------------------------------------------------------------------------------


def test_a_snapshot_stays_as_it_was() -> None:
    table = worlds.room()
    scene, same = tracer.load(table), tracer.load(table)
    kept = snapshot(scene)
    assert kept == same and contents_of(kept) == contents_of(same)
    scene.shapes[0].translate = (1.0, 0.0, 0.0)
    CHANGES["a key"](scene)
    scene.camera.rotate = (1.0, 2.0)
    CHANGES["the order"](scene)
    scene.materials.clear()
    assert kept == same and scene != same


def test_the_hash_of_a_result_is_that_of_the_scene_as_it_was_rendered() -> None:
    scene = tracer.load(worlds.room())
    results = [tracer.render(scene, backend="llvm")]
    scene.ambient = 0.9
    results.append(tracer.render(scene, backend="llvm"))
    hashes = [result.scene_hash for result in results]
    assert hashes[0] != hashes[1]
    assert hashes[0] == tracer.render(tracer.load(worlds.room()), backend="llvm").scene_hash
