"""What the viewer lets in and out: origins, tokens, messages, files."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import pytest

import tracer
from tracer.cli.app import run
from tracer.errors import OutputError, UsageError
from tracer.viewer.messages import LONGEST, Orbit, parse
from tracer.viewer.safety import Guard, is_loopback
from tracer.viewer.saving import Folder


@pytest.mark.parametrize(
    ("host", "answer"),
    [("127.0.0.1", True), ("127.8.9.1", True), ("localhost", True), ("::1", True), ("[::1]", True)]
    + [("0.0.0.0", False), ("192.168.1.2", False), ("localhost.evil.example", False), ("", False)],
)
def test_what_means_this_machine_alone(host: str, answer: bool) -> None:
    assert is_loopback(host) is answer


@pytest.mark.parametrize(
    ("headers", "refused"),
    [
        ({"host": "127.0.0.1:8433"}, None),
        ({"host": "localhost:8433", "origin": "http://localhost:8433"}, None),
        ({"host": "[::1]:8433", "origin": "http://[::1]:8433"}, None),
        ({"host": "127.0.0.1:8433", "origin": "http://evil.example"}, "another page"),
        ({"host": "127.0.0.1:8433", "origin": "http://127.0.0.1:8434"}, "another page"),
        ({"host": "127.0.0.1:8433", "origin": "http://localhost:8433"}, "another page"),
        ({"host": "127.0.0.1:8433", "origin": "null"}, "another page"),
        ({"host": "evil.example:8433", "origin": "http://evil.example:8433"}, "not this machine"),
        ({}, "not this machine"),
    ],
)
def test_other_pages_and_names_that_lead_here_are_refused(
    headers: dict[str, str], refused: str | None
) -> None:
    objection = Guard(loopback=True).objection(headers, None)
    assert objection is None if refused is None else refused in str(objection)


def test_a_token_serves_once() -> None:
    guard = Guard(loopback=False)
    headers = {"host": "192.168.1.2:8433"}
    assert "token" in str(guard.objection(headers, None))
    assert guard.exchange("wrong") is None
    cookie = guard.exchange(guard.token)
    assert cookie is not None and guard.objection(headers, cookie) is None
    assert guard.exchange(guard.token) is None
    assert "token" in str(guard.objection(headers, "wrong"))
    assert "another page" in str(guard.objection(headers | {"origin": "http://evil.example"}, cookie))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "x",
        b"\x00\xff",
        "[]",
        "{}",
        '{"kind": "quit"}',
        '{"kind": "set", "name": "ambient", "value": "1"}',
        '{"kind": "set", "name": "ambient", "value": true}',
        '{"kind": "set", "name": "ambient", "value": 1, "more": 1}',
        '{"kind": "paint", "name": "background", "color": "red"}',
        '{"kind": "paint", "name": "background", "color": "#fffffff"}',
        '{"kind": "paint", "name": "background", "color": "#ffffff\\n"}',
        '{"kind": "orbit", "left": NaN, "up": 0}',
        '{"kind": "orbit", "left": 1e30, "up": 0}',
        '{"kind": "look", "x": 1.5, "y": 0}',
        '{"kind": "save_still", "suffix": ".toml"}',
        '{"kind": "save_still", "suffix": "/../x.png"}',
        "[" * LONGEST,
        " " * (LONGEST + 1),
    ],
)
def test_a_bad_message_is_refused_in_one_line(text: str | bytes) -> None:
    with pytest.raises(UsageError) as caught:
        parse(text)
    assert len(str(caught.value).splitlines()) == 1


def test_a_good_message_is_a_record() -> None:
    message = parse(json.dumps({"kind": "orbit", "left": 5, "up": -1, "stamp": 12.5, "gesture": 3}))
    assert isinstance(message, Orbit) and (message.left, message.up, message.gesture) == (5.0, -1.0, 3.0)


def test_saving_takes_a_free_name_in_the_folder_and_no_other(tmp_path: Path) -> None:
    scene = tracer.load({})
    inside, outside = tmp_path / "inside", tmp_path / "outside"
    inside.mkdir()
    outside.mkdir()
    (inside / "_up-view-1.png").write_bytes(b"mine")
    (inside / "_up-view-2.toml").symlink_to(outside / "target.toml")
    folder = Folder(inside, "../up")
    saved = folder.save_scene(scene)
    assert saved == (inside / "_up-view-3.toml").resolve()
    assert folder.save_scene(scene) == saved, "the same scene keeps its name"
    assert folder.save_scene(tracer.load({})) == saved.with_name("_up-view-4.toml")
    assert (inside / "_up-view-1.png").read_bytes() == b"mine" and not list(outside.iterdir())
    assert tracer.load(saved) == scene


def test_a_folder_that_is_gone_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot be written"):
        Folder(tmp_path / "gone", "scene").save_scene(tracer.load({}))


def test_without_its_libraries_the_viewer_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *more: None if name == "uvicorn" else find(name, *more)
    )
    assert run(["view", "classic"]) == 3
    said = capsys.readouterr().err
    assert said == (
        "tracer: error: the viewer needs uvicorn, not installed here; "
        "`pip install whitted-tracer[viewer]` installs what it needs\n"
    )
