"""Whole files or none: what is left in the folder after success, failure and interruption."""

from __future__ import annotations

import os
import stat

import numpy as np
import pytest

from tracer.errors import OutputError, UsageError
from tracer.film.atomic import OUTPUT_SUFFIXES, atomic_write, check_writable, fill_template
from tracer.film.exr import write_exr
from tracer.film.png import write_png
from tracer.film.result import WRITERS


def test_success_replaces_the_file_and_leaves_nothing_else(tmp_path):
    target = tmp_path / "a.png"
    target.write_text("old")
    with atomic_write(target) as temporary:
        assert temporary.parent == tmp_path and temporary.suffix == ".png"
        temporary.write_text("new")
        assert target.read_text() == "old"
    assert target.read_text() == "new"
    assert os.listdir(tmp_path) == ["a.png"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemExit, ZeroDivisionError, MemoryError])
def test_any_interruption_leaves_the_old_file(tmp_path, error):
    target = tmp_path / "a.png"
    target.write_text("old")
    with pytest.raises(error), atomic_write(target) as temporary:
        temporary.write_text("half")
        raise error
    assert target.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.png"]


@pytest.mark.skipif(os.name != "posix", reason="permission bits are POSIX")
@pytest.mark.parametrize(("umask", "mode"), [(0o022, 0o644), (0o077, 0o600), (0o002, 0o664)])
def test_permissions_are_those_of_any_new_file(tmp_path, umask, mode):
    before = os.umask(umask)
    try:
        with atomic_write(tmp_path / "a.png"):
            pass
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a.png").stat().st_mode) == mode


def test_a_link_stays_a_link(tmp_path):
    real, link = tmp_path / "real.png", tmp_path / "link.png"
    real.write_text("old")
    link.symlink_to(real)
    with atomic_write(link) as temporary:
        temporary.write_text("new")
    assert link.is_symlink() and real.read_text() == "new"


@pytest.mark.skipif(os.name != "posix", reason="file size limits are POSIX")
@pytest.mark.parametrize("suffix", [".png", ".exr"])
def test_a_full_disk_is_one_sentence_and_no_file(tmp_path, capfd, suffix):
    resource = pytest.importorskip("resource")
    noise = np.random.default_rng(0).random((200, 200, 3))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, limits[1]))
    try:
        with pytest.raises(OutputError, match=f"a{suffix}: cannot be written: "):
            if suffix == ".png":
                write_png(tmp_path / "a.png", noise)
            else:
                write_exr(tmp_path / "a.exr", {"R": noise[..., 0]}, header={})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert os.listdir(tmp_path) == []


def test_check_writable_leaves_nothing_behind(tmp_path):
    for suffix in (*OUTPUT_SUFFIXES, ".PNG"):
        check_writable(tmp_path / f"a{suffix}")
    (tmp_path / "old.png").write_text("old")
    check_writable(tmp_path / "old.png")
    assert os.listdir(tmp_path) == ["old.png"]


def test_check_writable_refuses_no_name_at_all():
    with pytest.raises(OutputError, match='^"": is no file name$'):
        check_writable("")


def test_check_writable_takes_a_bare_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    check_writable("a.png")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("none/a.png", "none/a.png: the folder .*none does not exist$"),
        ("file/a.png", "file/a.png: .*file is not a folder$"),
        ("folder.png", "folder.png: is a folder, not a file name$"),
        ("a.jpg", 'a.jpg: the extension ".jpg" is unknown; allowed: .png, .exr, .npz$'),
        ("a", "a: has no extension; allowed: .png, .exr, .npz$"),
        ("n" * 300 + ".png", "n.png: cannot be written: File name too long"),
    ],
)
def test_check_writable_says_why_not(tmp_path, name, message):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(OutputError, match=message):
        check_writable(tmp_path / name)
    assert sorted(os.listdir(tmp_path)) == ["file", "folder.png"]


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root writes to every folder")
def test_a_read_only_folder_is_noticed(tmp_path):
    tmp_path.chmod(0o555)
    try:
        with pytest.raises(OutputError, match="a.png: cannot be written: Permission denied"):
            check_writable(tmp_path / "a.png")
    finally:
        tmp_path.chmod(0o755)


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="needs a folder that refuses files even to root")
def test_a_folder_that_refuses_files_is_noticed():
    with pytest.raises(OutputError, match="a.png: cannot be written: "):
        check_writable("/proc/self/a.png")


def test_every_extension_has_a_writer():
    assert set(WRITERS) == set(OUTPUT_SUFFIXES)


@pytest.mark.parametrize(
    ("template", "frame", "expected"),
    [
        ("out/{name}.png", None, "out/classic.png"),
        ("{name}_{frame:04d}.png", 7, "classic_0007.png"),
        ("{frame}.exr", 12, "12.exr"),
        ("plain.png", 3, "plain.png"),
        ("{{{name}}}.png", None, "{classic}.png"),
    ],
)
def test_templates(template, frame, expected):
    assert fill_template(template, "classic", frame) == expected


def test_a_name_never_chooses_the_folder():
    assert fill_template("out/{name}.png", "../a\\b") == "out/.._a_b.png"


@pytest.mark.parametrize(
    ("template", "frame", "message"),
    [
        ("{scene}.png", None, r"unknown field \{scene\}; allowed: \{name\}, \{frame:04d\}"),
        ("{}.png", None, r"unknown field \{\}"),
        ("{name.__class__}.png", None, r"unknown field \{name.__class__\}"),
        ("{frame:04d}.png", None, r"\{frame\} has no value"),
        ("{frame:q}.png", 1, "bad format of a field"),
        ("{name:04d}.png", 1, "bad format of a field"),
        ("{frame:{width}d}.png", 1, "bad format of a field"),
        ("{name.png", None, r'file name "\{name.png": '),
    ],
)
def test_bad_templates_are_refused(template, frame, message):
    with pytest.raises(UsageError, match=message):
        fill_template(template, "classic", frame)
