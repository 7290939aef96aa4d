"""`tracer classic`: six questions at a terminal or answered from a pipe, and the room that they ask for."""

from __future__ import annotations

import itertools
import os
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tracer
from tracer.cli.classic_room import load_room, set_down
from tracer.cli.questions import QUESTIONS, choices
from tracer.errors import SceneError
from tracer.film.result import load_picture_file
from tracer.render import scene_hash
from tracer.scene import Plane, Scene
from tracer.scene_warnings import finite_extents, warnings_of

COMMAND = [sys.executable, "-m", "tracer.cli", "classic", "--scale", "0.02", "--supersample", "1"]
KEYS = [question.key for question in QUESTIONS]
ONES = 59 * "1"  # as much of a long answer as a message repeats
ALL_FLAGS = "--wallpaper trees --texture-3d --tetrahedron --cube --no-rabbit --no-rotate".split()

Run = Callable[..., subprocess.CompletedProcess[str]]


def chosen(answers: str) -> dict[str, bool]:
    """The choices for six digits in the document's order."""
    return {key: digit == "1" for key, digit in zip(KEYS, answers, strict=True)}


@pytest.fixture
def classic(repository: Path, tmp_path: Path) -> Run:
    """Runs `tracer classic` in an empty folder, with text or a file as stdin."""

    def run(*arguments: str, stdin: str | int = "") -> subprocess.CompletedProcess[str]:
        given: dict[str, Any] = {"input": stdin} if isinstance(stdin, str) else {"stdin": stdin}
        return subprocess.run(
            [*COMMAND, *arguments],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(repository)},
            capture_output=True,
            text=True,
            timeout=120,
            **given,
        )

    return run


def saved(folder: Path, name: str = "room.toml") -> str:
    """The hash of the scene that `--save` wrote."""
    return scene_hash(tracer.load(folder / name))


def expected(answers: str, *overrides: str) -> str:
    """The hash of the scene for six answers."""
    return scene_hash(load_room(chosen(answers), overrides))


# ---- the rooms ----


@pytest.fixture(scope="module")
def rooms() -> dict[str, Scene]:
    """All 64 rooms by their answers."""
    return {
        answers: load_room(chosen(answers), ()) for answers in map("".join, itertools.product("01", repeat=6))
    }


def test_no_two_rooms_are_the_same_and_none_has_warnings(rooms: dict[str, Scene]) -> None:
    assert len({scene_hash(room) for room in rooms.values()}) == 64
    assert all(warnings_of(room) == [] for room in rooms.values())


@pytest.mark.parametrize(
    ("answers", "name"), [("111100", "classic"), ("111110", "classic_rabbit"), ("111101", "classic_rotated")]
)
def test_the_pictures_of_the_document_are_among_them(
    answers: str, name: str, rooms: dict[str, Scene]
) -> None:
    assert rooms[answers] == tracer.load(name)
    assert scene_hash(rooms[answers]) == scene_hash(tracer.load(name))
    assert rooms[answers].name == "classic"


def test_each_answer_decides_its_part(rooms: dict[str, Scene]) -> None:
    views = [tracer.load("classic").camera, tracer.load("classic_rotated").camera]
    for answers, room in rooms.items():
        trees, texture, tetrahedron, cube, rabbit, rotate = (digit == "1" for digit in answers)
        shapes = {shape.name: shape for shape in room.shapes}
        assert room.textures["forest"].to_dict()["file"].endswith("forest.png" if trees else "fox.png")
        assert (shapes["marble ball"].texture is not None) == texture
        assert ("tetrahedron" in shapes, "cube" in shapes) == (tetrahedron, cube)
        assert ("rabbit" in shapes, "shelf" in shapes) == (rabbit, rabbit)
        assert room.camera == views[rotate]


def floating(room: Scene) -> list[str]:
    """The spheres and meshes more than 5 units, a 200th of the room, from all that could hold them."""
    extents = finite_extents(room)
    boxes = {n: ((p - r).min(axis=0), (p + r).max(axis=0)) for n, (p, r) in extents.items()}
    planes = [shape.placed_coefficients() for shape in room.shapes if isinstance(shape, Plane)]
    loose = []
    for number, (low, high) in boxes.items():
        points, radius = extents[number]
        held = any((points @ plane[:3] + plane[3] - radius).min() < 5 for plane in planes)
        for other, (under_low, under_high) in boxes.items():
            above = (under_low < (low + high) / 2) & ((low + high) / 2 < under_high)
            held |= other != number and abs(low[1] - under_high[1]) < 5 and bool(above[[0, 2]].all())
        if not held:
            loose.append(str(room.shapes[number].name))
    return loose


def test_nothing_hovers(rooms: dict[str, Scene]) -> None:
    assert {answers: floating(room) for answers, room in rooms.items() if floating(room)} == {}


def test_the_check_for_hovering_would_see_it() -> None:
    assert floating(tracer.load({"base": "classic", "remove": ["cube"]})) == ["golden ball"]


def test_what_stood_on_the_cube_takes_its_place(rooms: dict[str, Scene]) -> None:
    for answers in ("111000", "011011"):
        room = rooms[answers]
        (number,) = [n for n, shape in enumerate(room.shapes) if shape.name == "golden ball"]
        points, radius = finite_extents(room)[number]
        assert points[0, 1] - radius == pytest.approx(0, abs=1)


@pytest.mark.parametrize("edge", [30.0, 90.0, 200.0])
def test_a_whole_pile_is_set_down(edge: float) -> None:
    """Whatever the numbers: what stands on a shape that goes comes down with all that stands on it."""
    ball = {"kind": "sphere", "radius": 20.0}
    room = tracer.load(
        {
            "shapes": [
                {**ball, "name": "top", "center": [3, 2 * edge + 61, 0], "translate": [5, 0, 0]},
                {**ball, "name": "lower", "center": [8, 2 * edge + 20.5, 0]},
                {**ball, "name": "beside", "center": [edge + 40, 2 * edge + 20.5, 0]},
                {"kind": "mesh", "name": "cube", "builtin": "cube", "scale": edge, "translate": [0, edge, 0]},
            ]
        }
    )
    moves = {move["name"]: move["translate"] for move in set_down(room, ["cube"])}
    assert moves == {"lower": [0, pytest.approx(-2 * edge - 0.5), 0], "top": [5, moves["lower"][1], 0]}
    assert set_down(room, []) == set_down(room, ["beside"]) == []


def test_values_of_the_user_come_last() -> None:
    room = load_room(chosen("000000"), ('shapes."marble ball".color="#102030"', "camera.rotate=[5, 0]"))
    assert list(room.camera.rotate) == [5, 0]
    (ball,) = [shape for shape in room.shapes if shape.name == "marble ball"]
    assert ball.to_dict()["color"] == "#102030"
    with pytest.raises(SceneError, match="shapes.cube.* is unknown"):
        load_room(chosen("000000"), ("shapes.cube.scale=3",))


@pytest.mark.slow
def test_each_answer_changes_the_picture(rooms: dict[str, Scene]) -> None:
    def picture(answers: str) -> np.ndarray:
        return tracer.render(rooms[answers], scale=0.05, supersample=1).color

    default = picture("111100")
    for place in range(6):
        other = list("111100")
        other[place] = "0" if other[place] == "1" else "1"
        changed = np.abs(picture("".join(other)) - default).max(axis=2) > 0.05
        assert changed.sum() > 10, QUESTIONS[place].prompt
        assert np.ptp(np.argwhere(changed), axis=0).min() > 2


# ---- answers from a pipe, a file, flags ----


def test_nothing_said_gives_the_classic_scene(classic: Run, repository: Path, tmp_path: Path) -> None:
    done = classic(stdin=subprocess.DEVNULL)
    assert (done.returncode, done.stderr) == (0, "")
    assert re.fullmatch(r"classic\.png  26x19  .*\n", done.stdout)
    again = subprocess.run(
        [*COMMAND[:3], "render", "classic", *COMMAND[4:], "-o", "other.png"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(repository)},
        capture_output=True,
        check=True,
    )
    assert again.stderr == b""
    assert (tmp_path / "classic.png").read_bytes() == (tmp_path / "other.png").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stdin", "answers"),
    [
        ("0\n1\n0\n1\n1\n1\n", "010111"),
        (" 0 0\t0\r\n\n0 1 0", "000010"),
        ("0 0", "001100"),
        ("", "111100"),
        ("\n\n", "111100"),
        ("1 1 1 1 0 0 and what follows is nobody's business", "111100"),
    ],
)
def test_answers_from_a_pipe(stdin: str, answers: str, classic: Run, tmp_path: Path) -> None:
    done = classic("--save", "room.toml", stdin=stdin)
    assert (done.returncode, done.stderr) == (0, "")
    assert saved(tmp_path) == expected(answers)
    assert load_picture_file(tmp_path / "classic.png").shape == (19, 26, 3)


@pytest.mark.slow
def test_a_closed_stdin_takes_the_defaults(classic: Run, repository: Path, tmp_path: Path) -> None:
    line = " ".join([*COMMAND, "--save", "room.toml", "<&-"])
    done = subprocess.run(
        ["sh", "-c", line], cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(repository)}, timeout=120
    )
    assert done.returncode == 0
    assert saved(tmp_path) == expected("111100")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("flags", "stdin", "answers"),
    [
        ("--wallpaper fox --rotate", "", "011101"),
        ("--wallpaper fox --no-cube", "1 1 0 1 1 1", "010011"),
        ("--no-texture-3d --no-tetrahedron --rabbit", "1 1 1 0", "100010"),
    ],
)
def test_a_flag_wins_over_the_answer_in_its_place(
    flags: str, stdin: str, answers: str, classic: Run, tmp_path: Path
) -> None:
    done = classic(*flags.split(), "--save", "room.toml", "--set", "ambient=0.3", stdin=stdin)
    assert (done.returncode, done.stderr) == (0, "")
    assert saved(tmp_path) == expected(answers, "ambient=0.3")


def test_with_six_flags_stdin_is_not_read(classic: Run, tmp_path: Path) -> None:
    """A pipe that nobody writes to or closes would be waited for; what is in it stays there."""
    reading, writing = os.pipe()
    try:
        os.write(writing, b"nonsense")
        done = classic(*ALL_FLAGS, stdin=reading)
        assert (done.returncode, done.stderr) == (0, "")
        assert os.read(reading, 100) == b"nonsense"
    finally:
        os.close(reading)
        os.close(writing)


@pytest.mark.slow
def test_after_the_last_answer_nothing_is_waited_for(classic: Run) -> None:
    """A program that writes its answers and keeps the pipe open is not kept waiting."""
    reading, writing = os.pipe()
    try:
        os.write(writing, b"1 1 1 1 0\n")
        assert classic("--rotate", stdin=reading).returncode == 0
    finally:
        os.close(reading)
        os.close(writing)


@pytest.mark.parametrize(
    ("stdin", "sentence"),
    [
        ("1 1 maybe", '3, `Add the tetrahedron: no <0> or yes <1>?`, is "maybe"; allowed: 0 or 1'),
        ("2", '1, `Wallpaper: fox <0> or trees <1>?`, is "2"; allowed: 0 or 1'),
        ("1 1 1 1 0 -1", '6, `Rotate the camera: no <0> or yes <1>?`, is "-1"; allowed: 0 or 1'),
        ("10", '1, `Wallpaper: fox <0> or trees <1>?`, is "10"; allowed: 0 or 1'),
        ("0 " + "1" * 5000, f'2, `Use the 3-D texture: no <0> or yes <1>?`, is "{ONES}…"; allowed: 0 or 1'),
    ],
)
def test_a_bad_answer_is_refused(stdin: str, sentence: str, classic: Run, tmp_path: Path) -> None:
    done = classic(stdin=stdin)
    assert done.stderr == f"tracer: error: stdin: answer {sentence}\n"
    assert (done.returncode, done.stdout, list(tmp_path.iterdir())) == (2, "", [])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--wallpaper", "bears"], "'bears' is not one of 'fox', 'trees'"),
        (["--save", "room.png"], 'room.png: the extension ".png" is unknown; allowed: .toml'),
        (["--save", "no/room.toml"], "no/room.toml: the folder no does not exist"),
        (["--set", "camera.fow=1"], "the nearest known key is `fov`"),
        (["-o", "x.gif"], 'x.gif: the extension ".gif" is unknown'),
        (["room"], "unexpected extra argument"),
    ],
)
def test_bad_arguments_are_refused(
    arguments: Sequence[str], sentence: str, classic: Run, tmp_path: Path
) -> None:
    done = classic(*arguments)
    assert re.fullmatch(f"tracer: error: .*{re.escape(sentence)}.*\n", done.stderr), done.stderr
    assert (done.returncode, done.stdout, list(tmp_path.iterdir())) == (2, "", [])


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="needs a file that opens and cannot be read")
def test_a_stdin_that_cannot_be_read(classic: Run) -> None:
    with open("/proc/self/mem", "rb") as file:
        done = classic(stdin=file.fileno())
    assert re.fullmatch("tracer: error: stdin: cannot be read: .*\n", done.stderr), done.stderr
    assert done.returncode == 2


def test_defaults_and_order_are_the_documents() -> None:
    assert KEYS == ["trees", "texture_3d", "tetrahedron", "cube", "rabbit", "rotate"]
    everything = chosen("010101")
    assert choices(everything) == everything


# ---- at a terminal ----


class Terminal:
    """`tracer classic` with a pseudo terminal as stdin; stderr goes there too, stdout is a pipe."""

    def __init__(self, repository: Path, folder: Path, *arguments: str) -> None:
        import pty

        self._master, slave = pty.openpty()
        self.process = subprocess.Popen(
            [*COMMAND, *arguments],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(repository)},
            stdin=slave,
            stderr=slave,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        os.close(slave)

    def wait_for(self, prompt: str) -> str:
        """What appears until `prompt` does; fails after a minute, or when the process ends before."""
        text, end = "", time.monotonic() + 60
        while prompt not in text:
            ready, _, _ = select.select([self._master], [], [], end - time.monotonic())
            assert ready, f"{prompt!r} does not appear: {text!r}"
            text += self._read()
        return text

    def type(self, keys: str) -> None:
        """Sends keys, as a hand would."""
        os.write(self._master, keys.encode())

    def finish(self) -> tuple[str, str]:
        """stdout, and what appears on the terminal until the process ends."""
        output, _ = self.process.communicate(timeout=60)
        text = ""
        while select.select([self._master], [], [], 0)[0] and (block := self._read()):
            text += block
        return output, text

    def close(self) -> None:
        """Ends the process."""
        self.process.kill()
        self.process.communicate()
        os.close(self._master)

    def _read(self) -> str:
        try:
            return os.read(self._master, 1000).decode()
        except OSError:  # Linux's way to say that the other end is closed
            return ""


@pytest.fixture
def terminal(repository: Path, tmp_path: Path) -> Iterator[Callable[..., Terminal]]:
    """Starts `tracer classic` at a pseudo terminal, in an empty folder."""
    pytest.importorskip("pty", reason="needs pseudo terminals")
    started: list[Terminal] = []

    def start(*arguments: str) -> Terminal:
        started.append(Terminal(repository, tmp_path, *arguments))
        return started[-1]

    yield start
    for one in started:
        one.close()


@pytest.mark.slow
def test_a_conversation(terminal: Callable[..., Terminal], tmp_path: Path) -> None:
    """Each question shows its default; Enter takes it, a wrong answer is asked again."""
    talk = terminal("--save", "room.toml", "--progress", "none")
    for question, keys in zip(QUESTIONS, ("0\n", "\n", "no\n", " 1 \n", "1\n", "\n"), strict=True):
        prompt = f"{question.prompt} [{question.default:d}] "
        assert talk.wait_for(prompt).endswith(prompt)
        talk.type(keys)
        if keys == "no\n":
            again = talk.wait_for(prompt)
            assert '"no" is no answer; allowed: 0, 1 or Enter for the one in []\r\n' in again
            talk.type("0\n")
    output, _ = talk.finish()
    assert talk.process.returncode == 0
    assert re.fullmatch(r"classic\.png  26x19  .*\n", output)
    assert saved(tmp_path) == expected("010110")


@pytest.mark.slow
def test_only_what_no_flag_answers_is_asked(terminal: Callable[..., Terminal], tmp_path: Path) -> None:
    talk = terminal("--wallpaper", "fox", "--texture-3d", "--no-tetrahedron", "--cube", "--save", "room.toml")
    assert talk.wait_for("[0] ").startswith("Add the more complex OBJ object, the rabbit: no <0> or yes <1>?")
    talk.type("1\n")
    assert "Rotate the camera" in talk.wait_for("[0] ")
    talk.type("\x04")  # Ctrl-D, the end of input
    _, text = talk.finish()
    assert (talk.process.returncode, text[:2]) == (0, "\r\n")
    assert saved(tmp_path) == expected("010110")


@pytest.mark.slow
def test_with_six_flags_nothing_is_asked(terminal: Callable[..., Terminal]) -> None:
    talk = terminal(*ALL_FLAGS, "--progress", "none")
    output, text = talk.finish()
    assert (talk.process.returncode, text) == (0, "")
    assert output.startswith("classic.png")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_at_a_question(
    number: signal.Signals, terminal: Callable[..., Terminal], tmp_path: Path
) -> None:
    talk = terminal()
    talk.wait_for("[1] ")
    talk.process.send_signal(number)
    assert talk.finish() == ("", "\r\n")
    assert talk.process.returncode == 128 + number
    assert list(tmp_path.iterdir()) == []
