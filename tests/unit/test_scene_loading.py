"""Scene files: reading, names, files, and every way in which they can be wrong."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tracer import assets
from tracer.errors import SceneError
from tracer.scene import Scene, find_scene, load
from tracer.scene.toml_files import LARGEST_FILE


def _write(path: Path, text: str | bytes = "version = 1\n") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


PICTURE = '[textures.wall]\nkind = "image"\nfile = "{}"\n'


def test_file_gives_name_and_folder(tmp_path: Path) -> None:
    scene = load(_write(tmp_path / "my room.toml", "ambient = 0.5"))
    assert (scene.name, scene.base_dir, scene.ambient) == ("my room", tmp_path, 0.5)


def test_byte_order_mark_is_skipped(tmp_path: Path) -> None:
    assert load(str(_write(tmp_path / "a.toml", b"\xef\xbb\xbfambient = 0.5\r\n"))).ambient == 0.5


def test_every_built_in_scene_is_found_by_name() -> None:
    for name, path in assets.builtin_scenes().items():
        assert find_scene(name) == (path, name)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a = ", "a.toml, line 1, column 5: not valid TOML: "),
        ("a = 1\nb = [1,\n", "a.toml, line 3, column 1: not valid TOML: "),
        ("a = 1\na = 2", "a.toml, line 2, column 6: not valid TOML: Cannot overwrite a value"),
        (b"a = 1\nb = '\xff'", "a.toml, line 2, column 6: the byte 0xff is no UTF-8 text"),
        (bytes(range(128, 256)), "a.toml, line 1, column 1: the byte 0x80 is no UTF-8 text"),
        (b"\x7fELF\x02\x01\x01\x00", "a.toml, line 1, column 1: not valid TOML: "),
        ("a = " + "[" * 100_000, "a.toml: is nested too deeply; a scene needs six levels"),
        ("a" + ".a" * 100 + " = 1", "a.toml: `a` is unknown; "),
        ("ambient = 1979-05-27", "a.toml: `ambient` is a date; allowed: a number"),
        ("ambient = " + "1" * 400, "a.toml: `ambient` is a number of more than 60 digits; allowed: a number"),
        ("ambient = inf", "a.toml: `ambient` is inf; allowed: a finite number"),
        (
            "[[shapes]]\nkind = 'sphere'\nname = 'green ball'\n",
            'a.toml: `shapes."green ball".center` is missing',
        ),
    ],
)
def test_wrong_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str | bytes, words: str) -> None:
    _write(tmp_path / "a.toml", text)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SceneError) as caught:
        load("a.toml")
    assert str(caught.value).startswith(words)
    assert len(str(caught.value)) < 500


def test_thousands_of_levels_end_in_a_sentence(tmp_path: Path) -> None:
    """Which of the two comes first depends on how deep the Python version recurses."""
    path = tmp_path / "deep.toml"
    _write(path, "a" + ".a" * 3000 + " = 1")
    with pytest.raises(SceneError, match="`a` is unknown|is nested too deeply"):
        load(path)


def test_huge_file_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "huge.toml"
    with open(path, "wb") as file:
        file.truncate(LARGEST_FILE + 1)
    with pytest.raises(SceneError, match=rf"has {LARGEST_FILE + 1} bytes; allowed: at most {LARGEST_FILE}"):
        load(path)


def test_deep_dict_is_refused() -> None:
    deep: dict[str, object] = {}
    for _ in range(100_000):
        deep = {"camera": deep}
    with pytest.raises(SceneError, match="scene: is nested too deeply"):
        load(deep)


def test_source_that_is_no_scene(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"nothing\.toml: there is no such scene file"):
        load(tmp_path / "nothing.toml")
    with pytest.raises(SceneError, match="is a directory; allowed: a scene file"):
        load(tmp_path)
    with pytest.raises(SceneError, match="is no usable file name"):
        load("a\0b.toml")
    with pytest.raises(SceneError, match='^scene: "" is no usable file name$'):
        load("")
    with pytest.raises(SceneError, match="is no usable file name|there is no such scene file"):
        load("a" * 5000)
    with pytest.raises(SceneError, match="5 is no scene; allowed: a path, a built-in name or a dict"):
        load(5)  # type: ignore[arg-type]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_pipe_is_refused_without_waiting(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.toml")
    with pytest.raises(SceneError, match="is not a regular file; allowed: a scene file"):
        load(tmp_path / "pipe.toml")


# ---- files that a scene names ----


def test_file_in_the_folder_and_below_is_found(tmp_path: Path) -> None:
    _write(tmp_path / "pictures" / "a.png")
    scene = load(_write(tmp_path / "a.toml", PICTURE.format("pictures/a.png")))
    assert scene.resolve("pictures/a.png") == (tmp_path / "pictures" / "a.png").resolve()
    assert load(scene.to_dict(), base_dir=tmp_path) == scene


@pytest.mark.parametrize("file", ["../a.png", "pictures/../../a.png", "{absolute}", "link/a.png"])
def test_file_outside_needs_permission(tmp_path: Path, file: str) -> None:
    outside = _write(tmp_path / "a.png")
    inside = tmp_path / "scenes"
    scene = _write(inside / "a.toml", PICTURE.format(file.format(absolute=outside.as_posix())))
    (inside / "link").symlink_to(tmp_path, target_is_directory=True)
    with pytest.raises(
        SceneError, match=r"`textures\.wall\.file` is .*, outside the scene's folder; allowed: "
    ):
        load(scene)
    assert load(scene, allow_outside=True).resolve(file.format(absolute=outside)) == outside.resolve()


def test_outside_is_said_whether_or_not_the_file_exists(tmp_path: Path) -> None:
    scene = _write(tmp_path / "scenes" / "a.toml", PICTURE.format("../nothing.png"))
    with pytest.raises(SceneError, match="outside the scene's folder"):
        load(scene)


def test_missing_file_directory_and_odd_name(tmp_path: Path) -> None:
    (tmp_path / "folder.png").mkdir()
    for file, words in (
        ("no.png", r'`textures\.wall\.file` is "no\.png", which does not exist; it is looked for in '),
        ("folder.png", r'`textures\.wall\.file` is "folder\.png", a directory; allowed: a file'),
        ("a\\u0000.png", "which is no usable file name"),
        ("a" * 5000 + ".png", "has 5004 characters; allowed: at most 4096"),
    ):
        with pytest.raises(SceneError, match=words):
            load(_write(tmp_path / "a.toml", PICTURE.format(file)))
    with pytest.raises(SceneError, match=r'`shapes\.rabbit\.file` is "no\.obj", which does not exist'):
        load({"shapes": [{"kind": "mesh", "name": "rabbit", "file": "no.obj"}]}, base_dir=tmp_path)
    with pytest.raises(SceneError, match=r'^scene: the file is "no\.obj", which does not exist'):
        Scene().come_from(base_dir=tmp_path).resolve("no.obj")


def test_assets_are_reached_from_everywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assets_folder = tmp_path / "somewhere" / "assets"
    picture = _write(assets_folder / "a.png")
    monkeypatch.setattr("tracer.scene.files.ASSETS", assets_folder)
    scene = load(_write(tmp_path / "mine" / "a.toml", PICTURE.format("assets/a.png")))
    assert scene.resolve("assets/a.png") == picture
    assert load(_write(tmp_path / "mine" / "b.toml", PICTURE.format("../somewhere/assets/a.png")))
    with pytest.raises(SceneError, match="outside the scene's folder"):
        load(_write(tmp_path / "mine" / "c.toml", PICTURE.format("assets/../../x.png")))
    own = _write(tmp_path / "mine" / "assets" / "a.png")
    assert scene.resolve("assets/a.png") == own
