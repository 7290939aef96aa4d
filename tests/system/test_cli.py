"""The command `tracer` as users run it: a process with its exit code, stdout and stderr."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import cv2
import numpy as np
import pytest

from tracer import load, pixel_tree
from tracer.film.exr import read_exr
from tracer.film.result import load_picture_file

Run = Callable[..., subprocess.CompletedProcess[str]]
COMMAND = [sys.executable, "-m", "tracer.cli"]

SMALL_SCENE = """
# One ball.
[camera]
resolution = [16, 12]
[[lights]]
kind = "point"
position = [300, 500, 400]
[[shapes]]
name = "ball"
kind = "sphere"
center = [0, 0, -100]
radius = 6
"""


def environment(repository: Path, extra: Mapping[str, str] | None = None) -> dict[str, str]:
    """This process's variables, with the checkout first on Python's path."""
    paths = [str(repository), os.environ.get("PYTHONPATH", "")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths)), **(extra or {})}


@pytest.fixture
def tracer(repository: Path, tmp_path: Path) -> Run:
    """Runs `tracer` in an empty folder that holds small.toml."""
    (tmp_path / "small.toml").write_text(SMALL_SCENE)

    def run(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [*COMMAND, *arguments],
            cwd=tmp_path,
            env=environment(repository, variables),
            capture_output=True,
            text=True,
            encoding="utf-8",
            stdin=subprocess.DEVNULL,
            timeout=120,
        )

    return run


def assert_refused(done: subprocess.CompletedProcess[str], message: str, code: int = 2) -> None:
    """The exit code, one line on stderr, nothing on stdout."""
    assert re.fullmatch(f"tracer: error: .*{message}.*\n", done.stderr), done.stderr
    assert done.stdout == ""
    assert done.returncode == code


def test_help_does_not_wait_for_dr_jit(tracer: Run) -> None:
    done = tracer("--help")
    assert done.returncode == 0
    assert "tracer render room" in done.stdout
    imported = subprocess.run(
        [sys.executable, "-X", "importtime", *COMMAND[1:], "--help"], capture_output=True
    )
    assert not {b"drjit", b"numpy", b"pydantic", b"cv2"} & set(re.findall(rb"\| +(\w+)\n", imported.stderr))


def test_a_picture_and_the_line_about_it(tracer: Run, tmp_path: Path) -> None:
    done = tracer("render", "small.toml")
    assert (done.returncode, done.stderr) == (0, "")
    assert re.fullmatch(r"small\.png  16x12  \d+\.\d\d s  \d+\.\d Mrays/s\n", done.stdout)
    picture = load_picture_file(tmp_path / "small.png")
    assert picture.shape == (12, 16, 3)
    assert picture[6, 8].min() > 0.1 > picture[0, 0].max()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["small.png", "small.toml"]


def test_options_reach_the_picture(tracer: Run, tmp_path: Path) -> None:
    done = tracer(
        *("render", "small.toml", "-o", "{name}-x.png", "-o", "x.exr", "-o", "x.npz"),
        *("--resolution", "32", "24", "--crop", "8", "4", "28", "20", "--supersample", "2", "--seed", "7"),
        *("--precision", "double", "--backend", "llvm", "--threads", "1"),
        *("--aov", "normal", "--aov", "shape"),
        *("--bits", "16", "--alpha", "--half", "--set", 'shapes."ball".radius=3', "--progress", "none"),
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("small-x.png, x.exr, x.npz  20x16  ")
    png = cv2.imread(str(tmp_path / "small-x.png"), cv2.IMREAD_UNCHANGED)
    assert png.shape == (16, 20, 4) and png.dtype == np.uint16
    with np.load(tmp_path / "x.npz") as arrays:
        metadata = json.loads(str(arrays["metadata"]))
        assert arrays["color"].dtype == np.float64
        assert set(arrays["shape"].ravel()) == {-1, 0}
        assert (
            60 < (arrays["shape"] == 0).sum() < 130
        )  # pi 5.3^2 and its border; four times that without --set
    assert (metadata["precision"], metadata["seed"], metadata["crop"]) == ("double", 7, [8, 4, 28, 20])


def test_statistics(tracer: Run) -> None:
    done = tracer("render", "small.toml", "--stats", "--quiet")
    assert done.returncode == 0
    phases = re.match(
        r"seconds +imports (.*), load .*, build .*, compile .*, trace .*, filter .*, write \d", done.stdout
    )
    assert phases and 0.05 < float(phases.group(1)) < 30
    assert re.search(r"\nrays +\d+: primary 192, shadow \d+, reflected 0,", done.stdout)
    assert re.search(r"\nkernels +\d+ compiled, \d+ read from the disk cache, \d+ reused", done.stdout)
    assert re.search(r"\nhits +ball \d+\n", done.stdout)
    assert re.search(r"\npeak memory +\d+ MiB\n$", done.stdout)


def test_statistics_as_a_file(tracer: Run, tmp_path: Path) -> None:
    """What was counted is the same for any number of threads and any memory, so headers hold it."""
    made = []
    for folder, option in (("a", ()), ("b", ("--threads", "1", "--memory", "1G"))):
        (tmp_path / folder).mkdir()
        files = ("-o", f"{folder}/x.exr", "-o", f"{folder}/y.png")
        assert tracer("render", "small.toml", "--stats", "--quiet", *files, *option).returncode == 0
        made.append(json.loads((tmp_path / folder / "x.stats.json").read_text()))
        assert made[-1]["seconds"].keys() == {
            "imports",
            "load",
            "build",
            "compile",
            "trace",
            "filter",
            "write",
        }
        assert made[-1]["kernels"].keys() == {"compiled", "from_disk", "reused"}
        assert made[-1]["peak_memory"] > 2**20
        for varies in ("seconds", "kernels", "peak_memory"):
            del made[-1][varies]
    assert made[0] == made[1] and not (tmp_path / "a" / "y.stats.json").exists()
    counted = made[0]
    assert counted["rays"]["primary"] == 192
    assert [(shape["shape"], shape["kind"], shape["name"]) for shape in counted["hits"]] == [
        (0, "sphere", "ball")
    ]
    assert 0 < counted["hits"][0]["hits"] < 192
    assert (tmp_path / "a" / "x.exr").read_bytes() == (tmp_path / "b" / "x.exr").read_bytes()
    header = read_exr(tmp_path / "a" / "x.exr")[1]
    assert header["raysPrimary"] == 192 and header["hitsPerShape"] == str(counted["hits"][0]["hits"])


def test_progress_as_json_lines(tracer: Run) -> None:
    done = tracer("render", "small.toml", "--progress", "json")
    lines = [json.loads(line) for line in done.stderr.splitlines()]
    assert [line["done"] for line in lines] == [0, 192]
    assert [line["scene"] for line in lines] == ["small", "small"]
    assert [line["remaining"] for line in lines] == [None, 0]
    assert lines[-1].keys() == {"scene", "done", "total", "rays", "seconds", "remaining"}
    assert lines[-1]["done"] == lines[-1]["total"] == 192
    assert lines[-1]["rays"] >= 192


def test_progress_as_a_bar(tracer: Run) -> None:
    done = tracer("render", "small.toml", "--progress", "bar")
    assert re.search(r"small 100 % \|.*\| 00:\d\d elapsed, 00:00 remaining, [\d.]+ Mrays/s", done.stderr)


@pytest.mark.parametrize("quiet", [False, True])
def test_a_terminal_shows_a_bar(quiet: bool, repository: Path, tmp_path: Path) -> None:
    """One that does not know its size, too, as pseudo terminals begin."""
    pty = pytest.importorskip("pty", reason="needs pseudo terminals")
    (tmp_path / "small.toml").write_text(SMALL_SCENE)
    shown, terminal = pty.openpty()
    subprocess.run(
        [*COMMAND, "render", "small.toml", *(["--quiet"] if quiet else [])],
        cwd=tmp_path,
        env=environment(repository),
        stdout=subprocess.DEVNULL,
        stderr=terminal,
        timeout=120,
        check=True,
    )
    os.write(terminal, b"over")
    text = b""
    while not text.endswith(b"over"):  # it comes in pieces
        text += os.read(shown, 10000)
    assert quiet == (text == b"over") and quiet != (b"small 100 %" in text)


def test_a_bad_scene_does_not_stop_the_others(tracer: Run, tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_text("ambiant = 1\n")
    (tmp_path / "late.toml").write_text(SMALL_SCENE + '[[shapes]]\nkind = "mesh"\nfile = "late.obj"\n')
    (tmp_path / "late.obj").write_text("f 1 2 3\n")  # found out only when the mesh is read
    done = tracer("render", "bad.toml", "late.toml", "nowhere.toml", "small.toml", "-o", "{name}.png")
    assert done.returncode == 2
    assert sorted(done.stderr.count(word) for word in ("ambiant", "late.obj", "nowhere.toml")) == [1, 1, 1]
    assert done.stderr.count("\n") == 3
    assert re.fullmatch(r"small\.png  16x12  .*\n", done.stdout)
    assert not (tmp_path / "bad.png").exists() and not (tmp_path / "late.png").exists()


def test_two_scenes_may_not_share_a_file(tracer: Run, tmp_path: Path) -> None:
    (tmp_path / "other.toml").write_text(SMALL_SCENE)
    assert_refused(
        tracer("render", "small.toml", "other.toml", "-o", "x.png"), "x.png: would be written for small"
    )
    assert_refused(tracer("render", "small.toml", "./small.toml"), "small.png: would be written for small")
    assert not list(tmp_path.glob("*.png"))


BAD_SCENES = {
    "unknown key": ("radios = 1", "radios` is unknown; the nearest known key is `radius`"),
    "wrong type": ('radius = "big"', 'radius` is "big"; allowed: a number'),
    "nan": ("radius = nan", "radius` is nan; allowed"),
    "zero radius": ("radius = 0", "radius` is 0; allowed: greater than 0"),
    "k_r + k_t > 1": (
        'radius = 1\nmaterial = "m"\n[materials.m]\nreflection = 0.7\nrefraction = 0.4',
        "materials.m",
    ),
    "negative weight": (
        'radius = 1\n[[lights]]\nkind = "point"\nposition = [0, 0, 0]\nweight = -1',
        "weight",
    ),
    "zero weights": (
        'radius = 1\n[[lights]]\nkind = "point"\nposition = [0, 0, 0]\nweight = 0',
        "weights that are all 0",
    ),
    "empty mesh": ('radius = 1\n[[shapes]]\nkind = "mesh"\nfile = "empty.obj"', "has no faces"),
    "no picture": (
        'radius = 1\ntexture = "t"\n[textures.t]\nkind = "image"\nfile = "no.png"',
        "neither a PNG nor a JPEG",
    ),
    "no resolution": (
        "radius = 1\n[camera]\nresolution = [0, 480]",
        "resolution.0` is 0; allowed: at least 1",
    ),
    "huge resolution": (
        "radius = 1\n[camera]\nresolution = [1000000000, 480]",
        "resolution.0` is 1000000000",
    ),
    "up along the view": (
        "radius = 1\n[camera]\norigin = [0, 9, 0]\ntarget = [0, 0, 0]\nfov = 40\nup = [0, 1, 0]",
        "parallel to the view",
    ),
    "syntax": ("radius = ", "bad.toml, line 4, column"),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", BAD_SCENES)
def test_a_bad_scene_is_refused_in_one_sentence(case: str, tracer: Run, tmp_path: Path) -> None:
    text, message = BAD_SCENES[case]
    (tmp_path / "bad.toml").write_text(f'[[shapes]]\nkind = "sphere"\ncenter = [0, 0, -100]\n{text}\n')
    (tmp_path / "empty.obj").write_text("v 0 0 0\n")
    (tmp_path / "no.png").write_text("not a picture\n")
    before = set(tmp_path.iterdir())
    assert_refused(tracer("render", "bad.toml"), re.escape(message))
    assert set(tmp_path.iterdir()) == before


BAD_ARGUMENTS = {
    "missing file": (("nowhere.toml",), "nowhere.toml: there is no such scene file"),
    "no scene": ((), "Missing argument 'SCENE...'"),
    "bad --set path": (
        ("small.toml", "--set", "camera.fow=40"),
        "fow` is unknown; the nearest known key is `fov`",
    ),
    "--set without a value": (("small.toml", "--set", "camera.fov"), "has no `=`"),
    "crop outside": (
        ("small.toml", "--crop", "0", "0", "17", "12"),
        "crop: 0 0 17 12 is empty or leaves the picture",
    ),
    "empty crop": (("small.toml", "--crop", "3", "3", "3", "9"), "crop: 3 3 3 9 is empty"),
    "unknown extension": (
        ("small.toml", "-o", "x.jpg"),
        'x.jpg: the extension ".jpg" is unknown; allowed: .png',
    ),
    "movie without frames": (
        ("small.toml", "-o", "x.gif"),
        "x.gif: is the name of a movie, which takes --frames, such as --frames 1:120",
    ),
    "missing folder": (("small.toml", "-o", "no/x.png"), "no/x.png: the folder no does not exist"),
    "unknown field": (("small.toml", "-o", "{nome}.png"), "unknown field {nome}"),
    "no frames here": (("small.toml", "-o", "{frame}.png"), "{frame} has no value"),
    "resolution 0": (("small.toml", "--resolution", "0", "9"), "0 is not in the range"),
    "resolution 10^9": (("small.toml", "--resolution", "1000000000", "1"), "1000000000 is not in the range"),
    "too many pixels": (("small.toml", "--resolution", "65535", "65535"), "allowed are 2^30 in all"),
    "scale 0": (("small.toml", "--scale", "0"), "scale: 0.0 is out of range"),
    "scale nan": (("small.toml", "--scale", "nan"), "scale: nan is out of range"),
    "supersample 0": (("small.toml", "--supersample", "0"), "0 is not in the range"),
    "unknown layer": (("small.toml", "--aov", "depht"), "depht' is unknown; allowed are depth, normal"),
    "unknown option": (("small.toml", "--sclae", "2"), "No such option.*--sclae.*--scale"),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", BAD_ARGUMENTS)
def test_bad_arguments_are_refused_in_one_sentence(case: str, tracer: Run, tmp_path: Path) -> None:
    arguments, message = BAD_ARGUMENTS[case]
    pattern = message if ".*" in message else re.escape(message)
    assert_refused(tracer("render", *arguments), pattern)
    assert [file.name for file in tmp_path.iterdir()] == ["small.toml"]


@pytest.mark.skipif(not Path("/proc/version").exists(), reason="needs a folder in which nobody may write")
def test_a_folder_that_cannot_be_written(tracer: Run) -> None:
    assert_refused(tracer("render", "small.toml", "-o", "/proc/x.png"), "/proc/x.png: cannot be written")


def test_commands_of_later_days_do_not_exist(tracer: Run) -> None:
    assert_refused(tracer("frobnicate"), "No such command 'frobnicate'")


def test_a_machine_without_llvm_ends_with_3(tracer: Run, tmp_path: Path) -> None:
    missing = str(tmp_path / "libLLVM.so")
    done = tracer("render", "small.toml", "--backend", "llvm", DRJIT_LIBLLVM_PATH=missing)
    assert_refused(done, "DRJIT_LIBLLVM_PATH names .*, which does not exist", code=3)
    assert not (tmp_path / "small.png").exists()


@pytest.mark.slow
def test_shapes_before_the_canvas_and_lost_paths_are_told(tracer: Run) -> None:
    near = "shapes.0.center=[0, 0, 400]"
    done = tracer("render", "small.toml", "--set", near)
    assert done.returncode == 0
    assert re.fullmatch(
        "tracer: warning: small: `shapes.ball` lies wholly between the eye and the canvas.*\n", done.stderr
    )
    assert "warning     small: `shapes.ball` lies" in tracer("info", "small.toml", "--set", near).stdout
    assert tracer("render", "small.toml", "--set", near, "--quiet").stderr == ""
    done = tracer("render", "room", "--scale", "0.05", "--set", "max_depth=1")
    assert re.search(r"warning: room: max_depth = 1 ended \d+ paths", done.stderr)


def test_scenes_and_info(tracer: Run) -> None:
    lines = tracer("scenes").stdout.splitlines()
    assert any(re.match(r"room +The benchmark room: four infinite planes", line) for line in lines)
    done = tracer("info", "room")
    assert done.returncode == 0
    for line in (
        r"shapes +9: 4 plane, 5 sphere",
        r"triangles +0",
        r"bounds +x -660 to 830, y 0 to 760, z -1330 to -110 \(without planes\)",
        r"lights +3: 3 point; 3 samples in all",
        r"camera +1024 x 1024 pixels, 1 ray each",
        r"memory +[\d.e-]+ MiB",
    ):
        assert re.search(f"^{line}", done.stdout, re.MULTILINE), line
    assert_refused(
        tracer("info", "rom"), "rom: there is no such scene file .* the nearest built-in scene is `room`"
    )


@pytest.mark.slow
def test_compare(tracer: Run, tmp_path: Path) -> None:
    picture = np.full((4, 5, 3), 100, np.uint8)
    for name, value in (("a", 100), ("b", 151)):
        picture[2, 3] = value
        cv2.imwrite(str(tmp_path / f"{name}.png"), picture)
    cv2.imwrite(str(tmp_path / "c.png"), picture[:3])
    same = tracer("compare", "a.png", "a.png")
    assert (same.returncode, same.stderr) == (0, "")
    assert re.match(r"maximum +0\n", same.stdout)
    other = tracer("compare", "a.png", "b.png", "--out", "d.png")
    assert (other.returncode, other.stderr) == (1, "")
    assert re.match(r"maximum +0\.2  at column 3, row 2\n", other.stdout)
    assert cv2.imread(str(tmp_path / "d.png"))[2, 3, 0] == 255
    assert tracer("compare", "a.png", "b.png", "--tolerance", "0.21").returncode == 0
    assert_refused(tracer("compare", "a.png", "c.png"), "different sizes: 5 x 4 and 5 x 3")
    assert_refused(tracer("compare", "a.png", "none.png"), "none.png: there is no such file")
    assert_refused(tracer("compare", "a.png", "b.png", "--tolerance", "nan"), "nan is not a number from 0 on")


def test_doctor(tracer: Run) -> None:
    done = tracer("doctor")
    assert done.returncode == 0
    assert "Everything that rendering needs is here." in done.stdout
    assert json.loads(tracer("doctor", "--json").stdout)["llvm"]["works"]


@pytest.mark.skipif(os.name != "posix", reason="needs a shell that closes a stream")
@pytest.mark.parametrize("closing", [">&-", "2>&-"])
def test_a_closed_stream_is_no_error(closing: str, repository: Path, tmp_path: Path) -> None:
    command = f"{shlex.join([*COMMAND, 'scenes'])} {closing}"
    done = subprocess.run(command, shell=True, cwd=tmp_path, env=environment(repository), capture_output=True)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.skipif(os.name != "posix", reason="needs a pipe whose reader is gone")
def test_a_reader_that_goes_away_is_no_error(repository: Path) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [*COMMAND, "scenes"], stdout=writing, stderr=subprocess.PIPE, env=environment(repository)
    )
    os.close(writing)
    assert (done.returncode, done.stderr) == (141, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device without space")
def test_no_space_for_the_output(repository: Path) -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*COMMAND, "scenes"], stdout=full, stderr=subprocess.PIPE, env=environment(repository), text=True
        )
    assert re.fullmatch("tracer: error: .*No space left on device\n", done.stderr)
    assert done.returncode == 2


def test_one_pixel_under_the_lens(tracer: Run, tmp_path: Path) -> None:
    """The last line is the color that a render writes; nothing is written."""
    done = tracer("render", "small.toml", "--pixel", "8", "6", "--set", "ambient=0.3")
    assert (done.returncode, done.stderr) == (0, "")
    assert "primary ray, weight 1: ball, primitive 0, at distance" in done.stdout
    assert "light 0 (point): visible; D (" in done.stdout
    assert [file.name for file in tmp_path.iterdir()] == ["small.toml"]
    shown = re.fullmatch(r"sum of 1 rays: \((.*)\)", done.stdout.splitlines()[-1])
    assert shown is not None
    tracer("render", "small.toml", "--set", "ambient=0.3", "-o", "a.npz")
    color = np.load(tmp_path / "a.npz")["color"][6, 8]
    assert np.allclose([float(number) for number in shown[1].split()], color, rtol=1e-5)


@pytest.mark.parametrize(
    ("more", "message"), [(("-o", "a.png"), "leave out either"), (("--frames", "1:2"), "leave out --frames")]
)
def test_one_pixel_is_no_picture(tracer: Run, more: tuple[str, str], message: str) -> None:
    assert_refused(tracer("render", "small.toml", "--pixel", "8", "6", *more), message)


def test_one_pixel_as_json(tracer: Run, tmp_path: Path) -> None:
    (tmp_path / "other.toml").write_text(SMALL_SCENE.replace("radius = 6", "radius = 5"))
    done = tracer(
        "render", "small.toml", "other.toml", "--pixel", "8", "6", "--precision", "double", "--json"
    )
    assert (done.returncode, done.stderr) == (0, "")
    trees = [json.loads(line) for line in done.stdout.splitlines()]
    scenes = [load(tmp_path / name) for name in ("small.toml", "other.toml")]
    expected = [pixel_tree(scene, 8, 6, precision="double").to_dict() for scene in scenes]
    assert trees == json.loads(json.dumps(expected))
    assert_refused(tracer("render", "small.toml", "--json"), "--json: .* with --pixel")


def test_a_pixel_outside_the_picture_is_refused(tracer: Run) -> None:
    assert_refused(tracer("render", "small.toml", "--pixel", "16", "6"), "0 <= X < 16 and 0 <= Y < 12")
