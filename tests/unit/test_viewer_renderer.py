"""The viewer's renderer without a browser: drafts, sharpening, what is dropped, what is never compiled."""

from __future__ import annotations

import queue
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator

import cv2
import drjit as dr
import numpy as np
import pytest

import tracer
from tracer.errors import SceneError
from tracer.lights import PointLight
from tracer.viewer import pictures
from tracer.viewer.controls import Slider
from tracer.viewer.drafts import compile_copies, compile_filters, draft_of
from tracer.viewer.frames import STILL_QUALITY, Frame, compressed
from tracer.viewer.layers import names_of, picture_of
from tracer.viewer.lens import looked_at
from tracer.viewer.memory import KernelBound, loaded_kernels
from tracer.viewer.pace import LADDER, Pace
from tracer.viewer.renderer import Renderer
from tracer.viewer.session import Session
from tracer.viewer.state import Source

PATIENCE = 60  # seconds within which a frame must come: kernels may have to be compiled


class Watcher:
    """A session with a renderer, and the frames that come of it."""

    def __init__(self) -> None:
        scene = tracer.load("optics_glass", overrides=["camera.resolution=[64, 48]", "camera.supersample=2"])
        self.session = Session(Source(lambda _: scene))
        self.frames: queue.Queue[Frame] = queue.Queue()
        self.complaints: list[str] = []
        self.looks = threading.Event()
        self.renderer = Renderer(
            self.session, self.frames.put, self.complaints.append, self.looks.is_set, backend="llvm"
        )
        self.renderer.start()

    def look(self) -> None:
        self.looks.set()
        self.renderer.wake()

    def until_rest(self) -> list[Frame]:
        """The frames up to the final one of the view that is wanted now."""
        found = [self.frames.get(timeout=PATIENCE)]
        while not (found[-1].final and found[-1].revision == self.session.view.revision):
            found.append(self.frames.get(timeout=PATIENCE))
        return found


@pytest.fixture
def watcher() -> Iterator[Watcher]:
    made = Watcher()
    yield made
    made.renderer.stop()
    assert not made.complaints


def pixels(frame: Frame) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(frame.jpeg, np.uint8), cv2.IMREAD_COLOR)


def test_a_draft_comes_first_and_the_picture_with_all_rays_last(watcher: Watcher) -> None:
    watcher.look()
    first, *_, last = watcher.until_rest()
    assert not first.final and first.supersample == 1
    assert (last.width, last.height, last.scale, last.supersample) == (64, 48, 1.0, 2)
    exact = tracer.render(watcher.session.view.scene, supersample=2)
    assert last.jpeg == compressed(picture_of("color", exact, legend=True), STILL_QUALITY)
    assert last.depth == float(exact.depth[24, 32])


def test_a_change_is_seen_and_answered_with_its_stamp(watcher: Watcher) -> None:
    watcher.look()
    before = pixels(watcher.until_rest()[-1]).astype(int)
    watcher.session.rotate(5.0, 0.0, stamp=12.5)
    first, *_, last = watcher.until_rest()
    assert first.stamp == last.stamp == 12.5
    assert np.abs(pixels(last) - before).mean() > 2


def test_nothing_is_rendered_while_nobody_looks(watcher: Watcher) -> None:
    for k in range(5):
        watcher.session.rotate(float(k + 1), 0.0)
    assert watcher.renderer.do(lambda: "done").result(timeout=PATIENCE) == "done"
    assert watcher.frames.empty()
    watcher.look()
    revisions = {frame.revision for frame in watcher.until_rest()}
    assert revisions == {watcher.session.view.revision}, "of six views only the last was rendered"


def test_a_picture_that_nobody_waits_for_is_given_up(
    watcher: Watcher, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The view changes between two bands of the picture with all rays."""
    monkeypatch.setattr(pictures, "RAYS_PER_BAND", 256)
    session, real = watcher.session, pictures.render
    changed = threading.Event()

    def render(*arguments: object, **settings: object) -> object:
        if settings["supersample"] == 2 and not changed.is_set():
            changed.set()
            session.rotate(5.0, 0.0)
        return real(*arguments, **settings)  # type: ignore[arg-type]

    monkeypatch.setattr(pictures, "render", render)
    watcher.look()
    frames = watcher.until_rest()
    assert changed.is_set() and watcher.renderer.dropped == 1
    assert not [frame for frame in frames[:-1] if frame.final]


def test_a_picture_that_fails_is_told_and_the_next_one_comes(
    watcher: Watcher, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, failures = pictures.render, [SceneError("the file is gone"), ValueError("a bug")]

    def render(*arguments: object, **settings: object) -> object:
        if failures:
            raise failures.pop(0)
        return real(*arguments, **settings)  # type: ignore[arg-type]

    monkeypatch.setattr(pictures, "render", render)
    watcher.look()
    while failures:
        time.sleep(0.01)
    watcher.session.rotate(5.0, 0.0)
    assert watcher.until_rest()[-1].final
    told, watcher.complaints[:] = list(watcher.complaints), []
    assert told == ["the file is gone", "unexpected ValueError: a bug"]


def test_an_error_of_a_task_goes_to_who_asked(watcher: Watcher) -> None:
    def task() -> None:
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        watcher.renderer.do(task).result(timeout=PATIENCE)


def test_no_kernel_is_compiled_while_sliders_move() -> None:
    """All sliders from end to end and all colors, in all sizes of drafts: those of the first picture do.

    Not in the renderer's thread: Dr.Jit's record of kernels does not survive threads that end.
    """
    scene = tracer.load("optics_glass", overrides=["camera.resolution=[64, 48]"])
    scene.lights = [*scene.lights, PointLight(position=(-4.0, 5.0, 5.0))]
    session = Session(Source(lambda _: scene))
    loaded = session.view.scene
    session.switch_focus(True, 300.0)
    compile_copies("llvm")
    compile_filters(session.view.scene, "llvm")

    def draft(scale: float) -> list[str]:
        """Renders, and says which kernels were new to this process."""
        tracer.render(draft_of(session.view.scene, loaded), backend="llvm", supersample=1, scale=scale)
        history = dr.kernel_history([dr.KernelType.JIT])
        return [one["hash"] for one in history if one["cache_disk"] or not one["cache_hit"]]

    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        draft(1.0)
        for number, control in enumerate(session.controls):
            for end in range(2):
                if isinstance(control, Slider):
                    session.set(control.name, (control.low, control.high)[end], gesture=number)
                else:
                    session.paint(control.name, ("#000000", "#ff8000")[end], gesture=number)
                assert draft(LADDER[number % len(LADDER)]) == [], (control.name, end)
            session.undo()
        session.orbit(7.0, 3.0)
        assert draft(1.0) == []


def test_every_layer_has_a_picture() -> None:
    scene = tracer.load("optics_glass", overrides=["camera.resolution=[32, 24]"])
    names = [name for name, _ in names_of(scene)]
    assert names[:6] == ["color", "depth", "normal", "shape", "level", "rays"]
    aovs = ("depth", "normal", "shape", "level", "rays", "visibility")
    result = tracer.render(scene, supersample=1, aovs=aovs)
    pictures = [picture_of(name, result, legend=False) for name in names]
    assert {(picture.shape, picture.dtype) for picture in pictures} == {((24, 32, 3), np.dtype(np.uint8))}
    assert all(picture.max() > picture.min() for picture in pictures)


def test_a_blank_picture_has_layers_too() -> None:
    scene = tracer.load({"camera": {"resolution": [16, 8]}, "background": "#204060"})
    result = tracer.render(scene, aovs=("depth", "normal", "shape", "level", "rays"))
    for name, _ in names_of(scene):
        assert picture_of(name, result, legend=True).shape == (8, 16, 3)


def test_the_rays_of_a_pixel_lie_in_the_picture() -> None:
    """The primary ray is a point; its child begins where it ends."""
    scene = tracer.load("optics_mirror", overrides=["camera.resolution=[64, 48]"])
    tree = looked_at(scene, 32, 24, "llvm")
    primary, *others = tree["rays"]
    assert primary["line"][1] == pytest.approx([32.5 / 64, 24.5 / 48], abs=1e-5)
    assert primary["line"][0] == pytest.approx(primary["line"][1], abs=1e-5)
    assert primary["weight"] == 1 and primary["shape"]
    children = [ray for ray in others if ray["level"] == 1]
    assert all(ray["line"][0] == pytest.approx(primary["line"][1], abs=1e-4) for ray in children)


def test_other_pixels_under_the_lens_compile_nothing() -> None:
    """Whatever the number of their rays: two are enough to have all kernels, with and without children."""
    glass = {"reflection": 0.3, "refraction": 0.6, "ior": 1.5}
    balls = [{"kind": "sphere", "center": [x, 0, -9], "radius": 1.2, "material": "glass"} for x in (-1, 1.2)]
    scene = tracer.load({"materials": {"glass": glass}, "shapes": balls, "cutoff": 0.01})
    scene.camera.resolution, scene.camera.pixel_size = (64, 48), 0.1
    for x, y in ((0, 0), (31, 24)):
        looked_at(scene, x, y, "llvm")
    sizes = set()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        for x in range(20, 44, 3):
            tree = looked_at(scene, x, 26, "llvm")
            sizes.add(tuple(Counter(ray["level"] for ray in tree["rays"]).values()))
        history = dr.kernel_history([dr.KernelType.JIT])
    assert len(sizes) > 3, sizes
    assert history and not [one for one in history if one["cache_disk"] or not one["cache_hit"]]


def test_a_renderer_at_rest_takes_no_time(watcher: Watcher) -> None:
    """Its thread waits; it does not turn in circles."""
    watcher.look()
    watcher.until_rest()
    before = watcher.renderer.do(time.thread_time).result(timeout=PATIENCE)
    time.sleep(0.5)
    assert watcher.renderer.do(time.thread_time).result(timeout=PATIENCE) - before < 0.1


def test_kernels_are_dropped_above_their_bound_and_come_back() -> None:
    scene = tracer.load("optics_glass", overrides=["camera.resolution=[32, 24]"])
    before = np.asarray(tracer.render(scene, backend="llvm").color)
    loaded = loaded_kernels()
    KernelBound(most=loaded).keep()
    tracer.render(scene, backend="llvm")
    assert loaded_kernels() == loaded, "below the bound nothing is dropped"
    bound = KernelBound(most=loaded - 1)
    bound.keep()
    assert np.array_equal(before, np.asarray(tracer.render(scene, backend="llvm").color))
    reloaded = loaded_kernels() - loaded
    assert reloaded > 0
    bound.keep()
    tracer.render(scene, backend="llvm")
    assert loaded_kernels() == loaded + reloaded, "the count begins anew"


def paced(pace: Pace, cost: Callable[[float], float], frames: int = 60) -> list[float]:
    """The scales of so many frames, of which each costs what its scale costs."""
    scales = []
    for _ in range(frames):
        scales.append(pace.scale)
        pace.took(pace.scale, cost(pace.scale))
    return scales


def test_the_pace_finds_the_largest_size_that_comes_in_time() -> None:
    pace = Pace(target=0.05)
    assert paced(pace, lambda scale: 0.2 * scale**2)[-20:] == [0.5] * 20, "which takes exactly the target"
    assert paced(pace, lambda scale: 0.03 * scale**2)[-20:] == [1.0] * 20
    assert paced(pace, lambda scale: 100 * scale**2)[-20:] == [LADDER[-1]] * 20


def test_the_pace_does_not_blur_where_that_gains_nothing() -> None:
    """What a frame costs apart from its size is more than the target; now and then a smaller one is tried."""
    scales = paced(Pace(target=0.05), lambda scale: 0.1 + 0.001 * scale**2, frames=400)
    assert min(scales) >= LADDER[1]
    assert sum(scale == 1.0 for scale in scales) > 380
