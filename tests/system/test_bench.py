"""`tracer bench` as users run it, in tiny pictures: the structure of what it writes, never its speed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from reference.bench.povray import find_povray
from reference.bench.rays import KINDS
from tracer.cli.app import run

pytest.importorskip("mitsuba")

TINY = ["--pixels", "16", "--repeat", "2", "--threads", "1", "--quiet"]
PEERS = ["tracer", "mitsuba", *(["povray"] if find_povray() else [])]


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.slow
def test_a_scene_in_full(capsys: pytest.CaptureFixture[str]) -> None:
    files = ["--out", "out", "--json", "all.json", "--summary", "all.md"]
    assert run(["bench", "--scene", "room", "--scene", "room-3k", *files, *TINY]) == 0
    assert capsys.readouterr().out == ""
    names = sorted(str(path.relative_to(Path.cwd())) for path in Path.cwd().rglob("*") if path.is_file())
    assert names == ["all.json", "all.md", "out/index.html", "out/index.json"]
    table = json.loads(Path("all.json").read_text("utf-8"))
    assert table == json.loads(Path("out/index.json").read_text("utf-8"))
    (group,) = table["groups"]
    assert [point["name"] for point in group["points"]] == ["room", "room-3k"]
    for point in group["points"]:
        assert [frame["peer"] for frame in point["frames"]] == PEERS
        assert [process["peer"] for process in point["processes"]] == PEERS
        ours, theirs = (frame["rays"] for frame in point["frames"][:2])
        assert ours["primary"] == theirs["primary"] == 256
        assert abs(ours["shadow"] - theirs["shadow"]) <= 3
        assert point["frames"][1]["differing"] < 0.02
        assert all(len(frame["trace"]["seconds"]) == 2 for frame in point["frames"])
        assert all(process["peak"] > 10 for process in point["processes"])
        for process in point["processes"]:
            assert 0 < process["first"] <= process["process"]
            compiles = process["peer"] != "povray"
            assert (process["warm"] is not None) == (process["warm_process"] is not None) == compiles
            assert not compiles or 0 < process["warm"] < min(process["first"], process["warm_process"])
    assert str(Path.cwd()) not in Path("out/index.html").read_text("utf-8")


@pytest.mark.slow
def test_curves_queries_and_builds(capsys: pytest.CaptureFixture[str]) -> None:
    parts = [
        word for part in ("threads", "lights", "recursion", "queries", "builds") for word in ("--only", part)
    ]
    assert run(["bench", *parts, "--out", "out", *TINY[:-1], "--progress", "json"]) == 0
    said = capsys.readouterr()
    steps = [json.loads(line) for line in said.err.splitlines() if line.startswith("{")]
    assert len(steps) == 1 + 3 + 3 + 1 + 1 and steps[-1]["done"] == steps[-1]["total"]
    assert said.out.splitlines()[-1] == "out/index.html, out/index.json"
    table = json.loads(Path("out/index.json").read_text("utf-8"))
    assert [group["name"] for group in table["groups"]] == ["lights", "recursion", "threads"]
    assert [(rate["kind"], rate["peer"]) for rate in table["rates"]] == [
        (kind, peer) for kind in KINDS for peer in ("tracer", "mitsuba")
    ]
    for ours, theirs in zip(table["rates"][::2], table["rates"][1::2], strict=True):
        assert ours["rays"] == theirs["rays"] > 0
        assert abs(ours["hits"] - theirs["hits"]) <= 2
    assert [build["triangles"] for build in table["builds"]] == [81920, 81920]


def test_without_peers(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    monkeypatch.setattr("reference.bench.peers.find_povray", lambda: None)
    assert run(["bench", "--only", "lights", "--out", "out", *TINY[:-1]]) == 0
    said = capsys.readouterr()
    assert "tracer: Mitsuba is not installed; `pip install" in said.err
    assert "tracer: POV-Ray is not installed; `apt install povray`" in said.err
    table = json.loads(Path("out/index.json").read_text("utf-8"))
    assert [frame["peer"] for frame in table["groups"][0]["points"][0]["frames"]] == ["tracer"]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--only", "speed"], '--only: "speed" is unknown; allowed: scenes, pixels, triangles, '),
        (["--scene", "nowhere"], "nowhere: there is no such scene file and no such built-in scene"),
        (["--json", "a.txt"], 'a.txt: the extension ".txt" is unknown; allowed: .json'),
        (["--repeat", "0"], "Invalid value for '--repeat'"),
    ],
)
def test_bad_usage(arguments: list[str], sentence: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["bench", *arguments]) == 2
    assert sentence in capsys.readouterr().err
    assert not [path for path in Path.cwd().rglob("*") if path.is_file()]


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_an_interrupted_run_leaves_nothing(repository: Path) -> None:
    path = os.pathsep.join(filter(None, [str(repository), os.environ.get("PYTHONPATH", "")]))
    command = [
        sys.executable,
        "-m",
        "tracer.cli",
        "bench",
        "--only",
        "lights",
        "--pixels",
        "64",
        "--progress",
        "json",
    ]
    process = subprocess.Popen(
        [*command, "--repeat", "1000", "--out", "out"],
        env={**os.environ, "PYTHONPATH": path},
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    assert json.loads(process.stderr.readline())["done"] > 0
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=120)[1]
    assert process.returncode == 130
    assert "interrupted: nothing was written" in said
    assert not list(Path("out").iterdir())
