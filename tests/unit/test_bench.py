"""The parts of `tracer bench`: scenes and rays from seeds, turns, ratios, the page. No speed is judged."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reference.bench import frames, peers, plan
from reference.bench.frames import Terms, measure
from reference.bench.icosphere import icosphere
from reference.bench.memory import high_water
from reference.bench.peers import Shot, hints
from reference.bench.rays import NUDGE, primary, secondary
from reference.bench.records import Benchmark, Build, Frame, Group, Point, Process, Rate, Series
from reference.bench.report import page_of, summary_of, table_of
from reference.bench.report.scaling import Scaling, scaling_of
from reference.bench.report.units import duration, ratio
from reference.bench.scenes import MESHES, SCENES, Workshop, lights, maker_of, mesh_alone, mirrors
from reference.bench.session import Request, to_dict
from tracer.backends import find_backend
from tracer.cache import bytes_of
from tracer.canvas import Canvas
from tracer.device_meshes import compile_meshes, placed_meshes
from tracer.errors import SceneError, UsageError
from tracer.scene import Scene, load

# ---- scenes and rays ----


def test_an_icosphere_is_closed_rough_and_the_same_every_time() -> None:
    vertices, triangles = icosphere(6, seed=3)
    assert len(triangles) == 20 * 36 and len(vertices) == 10 * 36 + 2
    edges = np.concatenate([triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    there = {tuple(edge) for edge in edges.tolist()}
    assert len(there) == len(edges) and {(b, a) for a, b in there} == there
    radii = np.linalg.norm(vertices, axis=1)
    assert radii.min() < 0.95 and radii.max() > 1.05
    np.testing.assert_array_equal(vertices, icosphere(6, seed=3)[0])
    assert (vertices != icosphere(6, seed=4)[0]).any()
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() > 0  # wound outward: its volume is positive


def test_a_mesh_is_read_back_as_it_was_made(tmp_path: Path) -> None:
    placed = placed_meshes(mesh_alone(Workshop(tmp_path), "3k"))[0]
    vertices, triangles = icosphere(MESHES["3k"], 20)
    np.testing.assert_array_equal(placed.corners, vertices.astype(np.float32)[triangles])


def test_scenes_keep_the_framing_of_the_room(tmp_path: Path) -> None:
    whole = Canvas.of(load("room").camera)
    for name in ("room", "room-3k", "spheres"):
        canvas = Canvas.of(SCENES[name](Workshop(tmp_path), 40).camera)
        assert (canvas.width, canvas.height) == (40, 40)
        assert canvas.width * canvas.pixel_size == pytest.approx(whole.width * whole.pixel_size)
    assert len(SCENES["spheres"](Workshop(tmp_path), 40).shapes) == 1009
    assert len(lights(Workshop(tmp_path), 40, 7).lights) == 7
    assert mirrors(Workshop(tmp_path), 40, 5).max_depth == 5


def test_a_scene_of_the_user_is_taken_too(tmp_path: Path) -> None:
    assert maker_of("texture_image")(Workshop(tmp_path), 32).camera.resolution[0] == 32
    with pytest.raises(SceneError, match="nowhere"):
        maker_of("nowhere")


def test_tiles_hold_the_same_rays_as_rows() -> None:
    rows, tiles = primary(16, tiles=False), primary(16, tiles=True)
    assert {tuple(d) for d in rows.d.tolist()} == {tuple(d) for d in tiles.d.tolist()}
    np.testing.assert_allclose(np.linalg.norm(tiles.d, axis=1), 1, rtol=1e-6)
    first = [np.flatnonzero((rows.d == d).all(axis=1))[0] for d in tiles.d[:64]]
    assert sorted(first) == [16 * row + column for row in range(8) for column in range(8)]


def test_secondary_rays_leave_the_surface() -> None:
    first = primary(8, tiles=True)
    t = np.where(np.arange(64) % 2, 2.0, np.inf)
    normal = np.where((np.arange(64) % 4 == 1)[:, None], -first.d, first.d).astype(np.float64)
    rays = secondary(first, t, normal)
    assert rays["mirror"].count == rays["diffuse"].count == 32 >= rays["shadow"].count
    np.testing.assert_allclose(rays["mirror"].d, -first.d[1::2], atol=1e-6)
    assert ((rays["diffuse"].d * first.d[1::2]).sum(axis=1) < 0).all()
    np.testing.assert_allclose(np.linalg.norm(rays["mirror"].o - first.o[1::2], axis=1), 2 - NUDGE, rtol=1e-5)


# ---- turns ----


class _Fake:
    """A renderer that only says when it was asked."""

    asked: list[str]

    def __init__(self, name: str, seconds: float) -> None:
        self.name, self.seconds = name, seconds

    def remake(self) -> None:
        self.asked.append(f"{self.name}, made anew")

    def frame(self) -> Shot:
        self.asked.append(self.name)
        return Shot(np.full((2, 2, 3), 0.5 if self.name == "tracer" else 0.6), self.seconds, 2 * self.seconds)

    def rays(self) -> dict[str, int]:
        return {"primary": 4}


def test_renderers_take_turns_and_stop_when_their_time_is_spent(monkeypatch: pytest.MonkeyPatch) -> None:
    _Fake.asked = asked = []
    for peer, seconds in (("tracer", 1.0), ("mitsuba", 2.0), ("povray", 30.0)):
        monkeypatch.setitem(frames.MAKERS, peer, lambda *_, peer=peer, seconds=seconds: _Fake(peer, seconds))
    terms = Terms(("tracer", "mitsuba", "povray"), 1, 3, 1e9, lambda: None)
    scene = Scene(camera={"resolution": (2, 2)})  # type: ignore[arg-type]
    point = measure("a", 1.0, scene, terms)
    turns = ["tracer", "mitsuba", "povray", "mitsuba", "povray", "tracer", "povray", "tracer", "mitsuba"]
    warm = [word for peer in ("tracer", "mitsuba") for word in (peer, f"{peer}, made anew", peer)]
    assert asked == [*warm, *turns]
    assert point.ratio("mitsuba") == 2 and point.ratio("povray", least=True) == 30
    assert point.frames[1].differing == 1 and point.frames[0].differing != point.frames[0].differing
    asked.clear()
    spent = measure("a", 1.0, scene, replace(terms, budget=0.0))
    assert [len(frame.trace.seconds) for frame in spent.frames] == [1, 1, 1]


def test_all_that_a_user_waits_for_has_the_scene_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Though tracer keeps what it made: reading the file and building the hierarchy count."""
    runner = peers.TracerRunner(SCENES["room-3k"](Workshop(tmp_path), 16))
    forgets: list[bool] = []
    monkeypatch.setattr(peers, "forget_everything", lambda: forgets.append(True))
    before = runner.frame()
    runner.remake()
    shot = runner.frame()
    assert forgets == [True]
    assert before.whole > before.trace and shot.whole > shot.trace + runner._made > shot.trace


def test_peers_that_are_not_installed_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    monkeypatch.setattr(peers, "find_povray", lambda: None)
    assert list(hints()) == ["mitsuba", "povray"]
    assert all("install" in hint for hint in hints().values())


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="only Linux says it")
def test_memory_is_that_of_the_program_and_not_of_its_parent() -> None:
    ballast = np.ones(100 * 2**17)  # 100 MiB in this process
    code = "from reference.bench.memory import high_water; print(high_water())"
    root = Path(peers.__file__).resolve().parents[2]
    said = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True)
    assert high_water() > 100 and ballast.all()
    assert 3 < float(said.stdout) < 100
    assert np.isnan(high_water("none"))


# ---- what is measured ----


def request(**changes: object) -> Request:
    asked = Request(False, (), (), 2, None, None, "tracer bench")
    return replace(asked, **changes)  # type: ignore[arg-type]


def test_the_set_follows_the_request(tmp_path: Path) -> None:
    assert request().chosen() == plan.QUICK and request(full=True).chosen() == plan.FULL
    small = request(full=True, pixels=600, repeat=2).chosen()
    assert (small.pixels, small.sizes, small.repeat) == (600, (256, 512), 2)
    assert request(pixels=16).chosen().sizes == (16,)
    assert request(scenes=("room",)).parts == ("scenes",) and request(only=("builds",)).parts == ("builds",)


def test_steps(tmp_path: Path) -> None:
    terms = Terms(("tracer", "povray"), 4, 1, 1.0, lambda: None)
    steps = plan.steps_of(plan.FULL, (), terms, Workshop(tmp_path))
    assert {step.part for step in steps} == set(plan.PARTS)
    assert [step.name for step in steps if step.part == "threads"] == ["1", "2", "4"]
    assert [step.name for step in plan.steps_of(plan.QUICK, ("builds",), terms, Workshop(tmp_path))] == [
        "82k"
    ]
    with pytest.raises(UsageError, match='^--only: "speed" is unknown; allowed: scenes, pixels, '):
        plan.steps_of(plan.QUICK, ("speed",), terms, Workshop(tmp_path))


# ---- what is written ----


NOTHING = float("nan")


def series(*seconds: float) -> Series:
    return Series(seconds)


def a_run() -> Benchmark:
    ours = Frame("tracer", series(0.1, 0.3, 0.2), series(0.4), {"primary": 64})
    theirs = Frame("mitsuba", series(0.25, 0.15), series(0.5), {"primary": 64}, 0.25)
    processes = (
        Process("tracer", 1.0, 0.4, 0.1, 2.0, 0.9, 160.0),
        Process("povray", 1.0, NOTHING, NOTHING, 1.0, NOTHING, 30.0),
    )
    scenes = Group("scenes", "Scenes", "scene", (Point("room <&>", 0, 64, (ours, theirs), processes),))
    curve = (Point("1", 1, 64, (ours,)), Point("2", 2, 64, (ours, theirs)))
    rates = [
        Rate("3k", "shadow", peer, 100, 5, series(0.1 * k)) for k, peer in ((2, "tracer"), (1, "mitsuba"))
    ]
    return Benchmark(
        {"date": "today", "command to repeat": "tracer bench"},
        (scenes, Group("lights", "The room, by lights", "point lights", curve)),
        tuple(rates),
        (Build("3k", 2880, "tracer", series(0.01), series(0.02)),),
        ["POV-Ray is not installed."],
    )


def test_the_page_is_one_file_with_all_numbers() -> None:
    text = page_of(a_run())
    assert not re.search(r"(?:src|href)=[\"'](?!#)|url\((?!#)", text)
    for part in (
        "room &lt;&amp;&gt;",
        "200 ms",
        "1.50",
        "160 MiB",
        "POV-Ray is not installed.",
        "tracer bench",
    ):
        assert part in text
    assert text.count("<svg") == 1 + 2 + 1  # bars of a renderer, a curve twice, bars of a mesh
    assert "Nothing was compared" in page_of(Benchmark({}, (), (), ()))


def test_the_cost_of_more_triangles() -> None:
    """Said of meshes that are exactly so far apart, and of nothing else."""
    kind = "primary, tile order"
    seconds = {"3k": (1.0, 1.0), "82k": (2.0, 1.0), "330k": (2.5, 1.2), "1.3M": (3.0, 1.75)}
    rates = tuple(
        Rate(mesh, kind, peer, 100, 100, series(each[k]))
        for mesh, each in seconds.items()
        for k, peer in enumerate(("tracer", "mitsuba"))
    )
    full, short = (Benchmark({}, (), kept, ()) for kept in (rates, rates[:4]))
    assert scaling_of(full) == [Scaling(kind, "82k", "1.3M", 1.5, 1.75)] and scaling_of(short) == []
    title = "What 16 times the triangles cost a ray, from 82k to 1.3M"
    for text in (page_of(full), summary_of(full), table_of(full)):
        assert title in text and "1.50" in text and "1.75" in text
    assert "times the cost of a primary ray for 16 times the triangles, to 1.3M (Embree: 1.75)" in summary_of(
        full
    )
    assert not any("triangles cost" in write(short) for write in (page_of, summary_of, table_of))
    ours = scaling_of(Benchmark({}, (), rates[2::2], ()))
    assert ours[0].tracer == 1.5 and np.isnan(ours[0].embree)


def test_the_page_says_what_a_triangle_takes(tmp_path: Path) -> None:
    """The bytes that it names are those of the arrays."""
    scene, backend = mesh_alone(Workshop(tmp_path), "3k"), find_backend("llvm", "single")
    mesh = placed_meshes(scene)[0]
    count = len(mesh.corners)
    tables = compile_meshes(scene, backend, {0: mesh}, np.array([0, count]))
    read, placed = bytes_of(mesh.data), bytes_of(mesh) - bytes_of(mesh.data)
    words = "keeps 44 bytes as read from the file, 97 as placed and 188 that rays read"
    assert words in page_of(a_run())
    np.testing.assert_allclose(
        [read / count, placed / count, bytes_of(tables) / count], [44, 97, 188], rtol=0.02
    )


def test_the_summary_gives_ratios() -> None:
    text = summary_of(a_run())
    assert "- **1.00** times as long as tracer takes Mitsuba 3 for a frame of room <&>" in text
    assert "| 2 | 200 ms (100 ms) | 200 ms (150 ms) | 1.00 (1.50) |" in text
    assert "| 3k | shadow | 0.00 | 0.00 | 0.50 |" in text
    assert "room <&>" in table_of(a_run()) and "Embree" in table_of(a_run())
    assert summary_of(Benchmark({}, (), (), ())).startswith("# Benchmark")


def test_numbers_for_programs() -> None:
    table = json.loads(json.dumps(to_dict(a_run()), allow_nan=False))
    frame = table["groups"][0]["points"][0]["frames"][0]
    assert frame["trace"] == {"median": 0.2, "least": 0.1, "seconds": [0.1, 0.3, 0.2]}
    assert frame["differing"] is None


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0123, "12.3 ms"),
        (2.0, "2.00 s"),
        (3e-5, "30.0 µs"),
        (150.0, "150 s"),
        (0.0, "0 s"),
        (float("nan"), "–"),
    ],
)
def test_durations(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_ratios() -> None:
    assert [ratio(value) for value in (0.5, 12.34, 1234.0, float("nan"))] == ["0.50", "12.3", "1,234", "–"]
