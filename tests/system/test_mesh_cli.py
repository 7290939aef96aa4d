"""Mesh files through the command `tracer`: every format is traced, damage is one sentence and exit code 2."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.unit.mesh_writers import stl_binary
from tests.unit.ugly_meshes import SQUARE, UGLY

pytestmark = pytest.mark.slow  # each runs two processes

SCENE = """
[camera]
resolution = [8, 6]
origin = [0.4, 0.3, 3]
target = [0.5, 0.5, 0]
fov = 30.0
[[shapes]]
kind = "mesh"
file = "{file}"
"""


def run(folder: Path, repository: Path, command: str, *options: str) -> subprocess.CompletedProcess[str]:
    """`tracer COMMAND scene.toml` in a folder."""
    return subprocess.run(
        [sys.executable, "-m", "tracer.cli", command, "scene.toml", *options],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(repository)},
        capture_output=True,
        text=True,
        timeout=120,
    )


def prepare(folder: Path, name: str, content: str | bytes) -> None:
    (folder / "scene.toml").write_text(SCENE.format(file=name))
    (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())


GLB = UGLY["plain.glb"].content
PLY = UGLY["binary_big_endian.ply"].content
assert isinstance(GLB, bytes) and isinstance(PLY, bytes)


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("a.obj", "v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n", "a.obj, line 2: a vertex is not finite"),
        (
            "a.ply",
            PLY.replace(b"face 3", b"face 2147483648"),
            "it ends before its 2147483648 entries of `face`",
        ),
        ("a.stl", stl_binary([SQUARE[:3]], count=2**31), "its header says 2147483648 facets"),
        ("a.glb", GLB[:-7], "its header says"),
        ("a.gltf", "", "is damaged or no glTF file (line 1 of its JSON: Expecting value)"),
        (
            "a.off",
            "OFF",
            '`shapes.0.file` is "a.off"; allowed: a file that ends in .obj, .ply, .stl, .gltf or .glb',
        ),
    ],
)
def test_damage_is_one_sentence(
    tmp_path: Path, repository: Path, name: str, content: str | bytes, sentence: str
) -> None:
    prepare(tmp_path, name, content)
    for command in ("render", "info"):
        done = run(tmp_path, repository, command)
        assert (done.returncode, done.stdout) == (2, "")
        assert sentence in done.stderr and done.stderr.count("\n") == 1
    assert not list(tmp_path.glob("*.png"))


def test_idle_triangles_are_told_once(tmp_path: Path, repository: Path) -> None:
    prepare(tmp_path, "again.obj", UGLY["again.obj"].content)
    told = "`shapes.0` (again.obj), of 4 triangles, has 1 without area (the first is 1)"
    info = run(tmp_path, repository, "info")
    assert (info.returncode, info.stdout.count(told), info.stderr) == (0, 1, "")
    render = run(tmp_path, repository, "render", "-o", "a.png")
    assert (render.returncode, render.stderr.count(told), (tmp_path / "a.png").exists()) == (0, 1, True)


@pytest.mark.parametrize("name", ["arrow.obj", "ascii.ply", "binary.stl", "nodes.gltf", "quantized.glb"])
def test_every_format_is_traced(tmp_path: Path, repository: Path, name: str) -> None:
    prepare(tmp_path, name, UGLY[name].content)
    done = run(tmp_path, repository, "info")
    assert done.returncode == 0 and f"triangles   {len(UGLY[name].triangles)}\n" in done.stdout
