"""`tracer validate` as users run it: the report, its files, one ray shown again, and everything that is
refused."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tracer.backends import has_cuda
from tracer.cli.app import run as run_here

pytest.importorskip("mitsuba")

Run = Callable[..., subprocess.CompletedProcess[str]]
COMMAND = [sys.executable, "-m", "tracer.cli", "validate"]

SMALL_SCENE = """
[camera]
resolution = [64, 48]
origin = [0, 1.5, 6]
target = [0, 1, 0]
fov = 40
[[lights]]
name = "lamp"
kind = "disk"
center = [3, 5, 4]
normal = [0, -1, 0]
radius = 0.5
samples = 4
[materials.glass]
ior = 1.5
reflection = 0.2
refraction = 0.6
[[shapes]]
name = "ball"
kind = "sphere"
center = [0, 1, 0]
radius = 1
material = "glass"
[[shapes]]
name = "floor"
kind = "plane"
coefficients = [0, 1, 0, 0]
"""


def environment(repository: Path, **more: str) -> dict[str, str]:
    """This process's variables, with the checkout first on Python's path."""
    paths = [str(repository), os.environ.get("PYTHONPATH", "")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths)), **more}


@pytest.fixture
def validate(repository: Path, tmp_path: Path) -> Run:
    """Runs `tracer validate` in an empty folder that holds small.toml."""
    (tmp_path / "small.toml").write_text(SMALL_SCENE)

    def run(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [*COMMAND, *arguments],
            cwd=tmp_path,
            env=environment(repository, **variables),
            capture_output=True,
            text=True,
            encoding="utf-8",
            stdin=subprocess.DEVNULL,
            timeout=300,
        )

    return run


@pytest.mark.slow
def test_a_scene_of_ones_own_gets_a_page_its_numbers_and_a_summary(validate: Run, tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text(
        "# Mine\n<!-- crossvalidation:begin -->\nold\n<!-- crossvalidation:end -->\nrest\n"
    )
    options = ("--rays", "2000", "--out", "report", "--json", "all.json", "--progress", "json")
    done = validate("small.toml", *options, "--summary", "s.md", "--headline", "README.md")
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[0].startswith("all ") and " passed: 1 scenes, " in done.stdout
    files = "report/index.html, report/index.json, all.json, s.md, README.md"
    assert done.stdout.splitlines()[1] == files
    steps = [json.loads(line) for line in done.stderr.splitlines()]
    assert steps[-1]["done"] == steps[-1]["total"] == len(steps)
    twin = json.loads((tmp_path / "all.json").read_text())
    assert twin == json.loads((tmp_path / "report" / "index.json").read_text())
    outcomes = {(outcome["term"], outcome["precision"]): outcome for outcome in twin["outcomes"]}
    assert all(outcome["verdict"] == "passed" for outcome in outcomes.values())
    for term in ("hits", "visibility", "refraction, sphere", "chain growth", "picture, Mitsuba"):
        assert outcomes[term, "double"]["rays"] > 0, term
    assert outcomes["distance, sphere", "double"]["ours_error"] < 16
    page = (tmp_path / "report" / "index.html").read_text()
    assert "small" in page and "tracer validate small.toml --rays 2000" in page
    readme = (tmp_path / "README.md").read_text()
    assert readme.startswith("# Mine\n") and readme.endswith("\nrest\n") and "old" not in readme
    assert (tmp_path / "s.md").read_text().startswith("# ")


@pytest.mark.slow
def test_a_broken_tolerance_is_told_and_ends_with_1(validate: Run, tmp_path: Path) -> None:
    """The scene's ball is moved on our side alone, by a package that stands in for a careless change."""
    (tmp_path / "sitecustomize.py").write_text(
        "import tracer.shapes.sphere as sphere\n"
        "true = sphere.Sphere.slot\n"
        "sphere.Sphere.slot = staticmethod(lambda types, row, *rest: true(types, row * 1.00001, *rest))\n"
    )
    paths = os.pathsep.join([str(tmp_path), str(Path(__file__).resolve().parents[2])])
    done = validate("small.toml", "--term", "distance, sphere", "--precision", "double", PYTHONPATH=paths)
    assert done.returncode == 1, done.stdout + done.stderr
    failed, verdict, files = done.stdout.splitlines()
    assert failed.startswith("failed: distance, sphere, small, double: failed; measured ")
    assert "guilty: ours" in failed and "replay: tracer validate small.toml --" in failed
    assert verdict.startswith("1 of 1 failed") and "crossvalidation" in files
    assert "failed" in (tmp_path / "reports" / "crossvalidation" / "index.html").read_text()


@pytest.mark.slow
def test_a_pixel_is_shown_vertex_by_vertex(validate: Run, tmp_path: Path) -> None:
    done = validate("small.toml", "--pixel", "32", "22")
    assert done.returncode == 0, done.stderr
    first, *vertices = done.stdout.split("\n\n")
    assert first.startswith("small: ray [")
    assert [block.split(":")[0] for block in vertices[:3]] == ["vertex -", "vertex R", "vertex T"]
    assert "  hits              ball                      ball                      ball" in vertices[0]
    assert "light lamp        4 of 4                    4 of 4" in vertices[0]
    assert "the first; weight 1" in vertices[0] and "refracted; weight 0.6" in vertices[2]
    assert "mirrored x" in vertices[0] and "refracted z" in vertices[0]
    color = vertices[-1].splitlines()
    assert color[0] == "color of the pixel, one ray" and color[1].split()[-2:] == ["plain", "version"]
    red = [float(cell) for cell in color[2].split()[1:]]
    assert len(red) == 4 and max(red) - min(red) < 1e-5 and red[0] > 0.1
    assert not list(tmp_path.glob("reports"))
    chain = validate("small.toml", "--ray", "0", "1", "6", "0", "0", "-2", "--events", "TT")
    assert chain.returncode == 0, chain.stderr
    blocks = chain.stdout.split("\n\n")
    assert blocks[0] == "small: ray [0.0, 1.0, 6.0] -> [0.0, 0.0, -1.0]\n".strip()
    distances = [line.split()[1:] for block in blocks for line in block.splitlines() if "distance" in line]
    assert distances == [["5.0"] * 4, ["2.0", "2.0", "2.0", "2.0"]]


@pytest.mark.slow
def test_the_command_of_a_ray_shows_what_the_outcome_says(validate: Run, tmp_path: Path) -> None:
    options = ("--set", "shapes.ball.radius=0.9", "--rays", "1000", "--term", "distance, sphere")
    assert validate("small.toml", *options, "--json", "all.json").returncode == 0
    (single, double) = json.loads((tmp_path / "all.json").read_text())["outcomes"]
    assert (single["precision"], double["precision"]) == ("single", "double")
    worst = double["worst"]
    words = shlex.split(worst["command"])
    assert words[:5] == ["tracer", "validate", "small.toml", "--set", "shapes.ball.radius=0.9"]
    shown = validate(*words[2:])
    assert shown.returncode == 0, shown.stderr
    (line,) = [line for line in shown.stdout.splitlines() if "distance" in line][:1]
    ours = float(worst["ours"].removeprefix("t = "))
    assert float(line.split()[1]) == pytest.approx(ours, rel=1e-14)


@pytest.mark.slow
def test_random_scenes_need_no_file(validate: Run) -> None:
    done = validate("--random", "1", "--seed", "5", "--rays", "500", "--term", "hits", "--out", "r")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("all 2 passed: 1 scenes, ")
    shown = validate("--random", "1", "--seed", "5", "--pixel", "0", "0", "--events", "R")
    assert shown.stdout.startswith("random-5: ray [")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["nothing.toml"], "nothing.toml"),
        (["small.toml", "--term", "hit"], "term: 'hit' is unknown; allowed are placement; camera rays; "),
        (["small.toml", "--rays", "5"], "100"),
        (["room", "room"], "room: another scene is called 'room' as well"),
        (
            ["small.toml", "--pixel", "64", "0"],
            "--pixel: 64 0 is outside the picture; allowed are columns 0 to 63",
        ),
        (["small.toml", "room", "--pixel", "0", "0"], "2 are named"),
        (["--pixel", "0", "0"], "0 are named"),
        (["small.toml", "--events", "RT"], "one of --pixel and --ray is needed"),
        (
            ["small.toml", "--pixel", "1", "1", "--events", "RX"],
            "'RX' contains 'X'; allowed are the letters R and T",
        ),
        (
            ["small.toml", "--ray", "0", "0", "0", "0", "0", "0"],
            "allowed are finite numbers, no zero direction",
        ),
        (["small.toml", "--out", "small.toml/x"], "small.toml/x: the folder cannot be made"),
        (["small.toml", "--json", "x.txt"], 'x.txt: the extension ".txt" is unknown'),
        (["small.toml", "--headline", "small.toml"], 'the extension ".toml" is unknown'),
        (["small.toml", "--headline", "no.md"], "no.md: cannot be read: No such file"),
        (["small.toml", "--set", "camera.fov=0"], "fov"),
    ],
)
def test_bad_usage_is_one_sentence_and_leaves_nothing(
    arguments: list[str],
    sentence: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "small.toml").write_text(SMALL_SCENE)
    monkeypatch.chdir(tmp_path)
    assert run_here(["validate", *arguments]) == 2
    said = capsys.readouterr()
    (line,) = said.err.splitlines()
    assert line.startswith("tracer: error: ") and sentence in line
    assert said.out == "" and not list(tmp_path.glob("**/index*"))


def test_a_gpu_that_is_not_there_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if has_cuda():
        pytest.skip("there is one")
    monkeypatch.chdir(tmp_path)
    assert run_here(["validate", "room", "--backend", "cuda"]) == 3
    assert "no NVIDIA GPU" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals as on POSIX systems")
def test_what_was_finished_is_kept_when_it_is_stopped(
    validate: Run, repository: Path, tmp_path: Path
) -> None:
    process = subprocess.Popen(
        [*COMMAND, "small.toml", "room", "--progress", "json", "--out", "report"],
        cwd=tmp_path,
        env=environment(repository),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    for _ in range(3):
        assert json.loads(process.stderr.readline())["done"] > 0
    process.send_signal(signal.SIGINT)
    output, talk = process.communicate(timeout=60)
    assert (process.returncode, output) == (130, "")
    assert "tracer: interrupted: report/index.partial.html holds what was finished" in talk
    assert "The run was stopped after" in (tmp_path / "report" / "index.partial.html").read_text()
    assert not (tmp_path / "report" / "index.html").exists()
