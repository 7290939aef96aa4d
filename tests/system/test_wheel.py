"""The wheel in an environment of its own: scenes and assets travel in it, and nothing else is needed."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tracer.assets import builtin_scenes
from tracer.film.result import load_picture_file

pytestmark = pytest.mark.slow

Run = Callable[..., subprocess.CompletedProcess[str]]


def environment(**more: str) -> dict[str, str]:
    """This process's variables without those that lead to Python packages of other places."""
    kept = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONHOME")}
    return {**kept, "PYTHONNOUSERSITE": "1", **more}


def call(command: list[str], folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Runs a command in a folder, with nothing on stdin; the caller looks at the exit code."""
    return subprocess.run(
        command,
        cwd=folder,
        env=environment(**variables),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=300,
    )


def call_well(command: list[str], folder: Path, **variables: str) -> str:
    """The stdout of a command that ends with 0."""
    done = call(command, folder, **variables)
    assert done.returncode == 0, f"{' '.join(command)}\n{done.stdout}{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def wheel(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of this checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check"]
    call_well([*pip, "wheel", "--no-deps", "--wheel-dir", str(folder), str(repository)], folder)
    (found,) = folder.glob("*.whl")
    return found


@pytest.fixture(scope="module")
def programs(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the programs of an environment that holds the wheel and what it depends on."""
    folder = tmp_path_factory.mktemp("environment")
    call_well([sys.executable, "-m", "venv", str(folder)], folder)
    found = folder / ("Scripts" if os.name == "nt" else "bin")
    pip = [str(found / "python"), "-m", "pip", "--disable-pip-version-check"]
    call_well([*pip, "install", str(wheel)], folder)
    return found


def test_the_wheel_holds_scenes_and_assets_and_no_leftovers(wheel: Path, repository: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    for folder in ("scenes", "assets"):
        files = [file for file in (repository / folder).glob("*.*") if file.is_file()]
        assert {f"tracer/data/{folder}/{file.name}" for file in files} <= names
    assert {"tracer/py.typed", "tracer/cli/classic.py", "reference/plain.py"} <= names
    assert {f"tracer/viewer/page/{name}" for name in ("index.html", "main.js", "viewer.css")} <= names
    assert "reference/report/templates/page.html.j2" in names
    assert "reference/bench/report/templates/bench.html.j2" in names
    assert not [name for name in names if "__pycache__" in name or name.endswith((".pyc", ".partial.png"))]
    assert not [name for name in names if name.split("/")[0] in ("tests", "scripts", "docs")]
    assert all(name.split("/")[0] in ("tracer", "reference") or ".dist-info/" in name for name in names)


def test_it_renders_from_an_empty_folder_what_the_checkout_renders(
    programs: Path, repository: Path, tmp_path: Path
) -> None:
    here, there = tmp_path / "installed", tmp_path / "checkout"
    commands = (["render", "classic"], ["classic", "-o", "asked.png"], ["render", "shape_teapot"])
    for folder, program, variables in (
        (here, [str(programs / "tracer")], {}),
        (there, [sys.executable, "-m", "tracer.cli"], {"PYTHONPATH": str(repository)}),
    ):
        folder.mkdir()
        for command in commands:
            call_well([*program, *command, "--scale", "0.1"], folder, **variables)
    for name in ("classic.png", "asked.png", "shape_teapot.png"):
        picture = load_picture_file(here / name)
        assert picture.std() > 0.05
        np.testing.assert_array_equal(picture, load_picture_file(there / name), err_msg=name)
    np.testing.assert_array_equal(
        load_picture_file(here / "classic.png"), load_picture_file(here / "asked.png")
    )


def test_it_lists_the_scenes_under_both_names(programs: Path, tmp_path: Path) -> None:
    for name in ("tracer", "whitted-tracer"):
        listed = call_well([str(programs / name), "scenes"], tmp_path)
        assert [line.split()[0] for line in listed.splitlines()] == list(builtin_scenes())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("arguments", [["validate"], ["export", "room", "--to", "mitsuba"]])
def test_what_needs_mitsuba_says_how_to_get_it(programs: Path, tmp_path: Path, arguments: list[str]) -> None:
    done = call([str(programs / "tracer"), *arguments], tmp_path)
    assert done.returncode == 3 and done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("tracer: error: Mitsuba is not installed; `pip install whitted-tracer[reference]`")
    assert list(tmp_path.iterdir()) == []


def test_it_needs_no_mitsuba_and_nothing_of_the_checkout(programs: Path, tmp_path: Path) -> None:
    python = str(programs / "python")
    done = call([python, "-c", "import mitsuba"], tmp_path)
    assert done.returncode == 1 and "No module named 'mitsuba'" in done.stderr
    found = call_well([python, "-c", "import tracer, reference.plain; print(tracer.__file__)"], tmp_path)
    assert Path(found.strip()).is_relative_to(programs.parent)
