"""`python -m scripts.measure_viewer`: how quick the live viewer is at the browser, and what it keeps.

Starts `tracer view` with a kernel cache of its own and drives its page in a headless browser on the same
machine, as tests do. Linux: memory and time of processes are read from /proc.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import product
from pathlib import Path
from statistics import median
from typing import Any

import click
import numpy as np

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
TICKS = os.sysconf("SC_CLK_TCK")
AT_REST = "() => window.viewer?.picture?.header?.final"
REPORT = 10
"""Milliseconds from one report of the mouse to the next."""

WARM_UP = 1 / 2
"""Share of the random interaction that the memory curve leaves out: caches fill first."""


def processes_below(root: int) -> list[int]:
    """A process and those that it started, and so on."""
    parents: dict[int, list[int]] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            parents.setdefault(int(fields[1]), []).append(int(entry.name))
    found = [root]
    for process in found:
        found += parents.get(process, [])
    return found


def seconds_of(root: int) -> float:
    """Processor time of a process and all below it."""
    total = 0
    for process in processes_below(root):
        try:
            fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        total += int(fields[11]) + int(fields[12])
    return total / TICKS


def megabytes_of(process: int) -> float:
    """Resident memory."""
    text = Path(f"/proc/{process}/status").read_text()
    return int(text.partition("VmRSS:")[2].split()[0]) / 1024


@contextmanager
def opened(scene: str, resolution: tuple[int, int], cache: Path) -> Iterator[tuple[Any, int, int]]:
    """The page of a viewer at rest, and the numbers of the tracer's process and of the browser's."""
    from playwright.sync_api import sync_playwright

    program = next((found for found in map(shutil.which, BROWSERS) if found), None)
    size = map(str, resolution)
    command = [sys.executable, "-m", "tracer.cli", "view", scene, "--resolution", *size, "--no-browser"]
    environment = {**os.environ, "DRJIT_CACHE_DIR": str(cache)}
    tracer = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    assert tracer.stdout is not None
    before = set(processes_below(os.getpid()))
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        driver = min(set(processes_below(os.getpid())) - before)
        page = browser.new_page(viewport={"width": 1180, "height": 720})
        page.goto(tracer.stdout.readline().strip())
        page.wait_for_function(AT_REST, timeout=120_000)
        try:
            yield page, tracer.pid, driver
        finally:
            browser.close()
            tracer.terminate()
            tracer.wait()


def measured(
    page: Any, tracer: int, browser: int, cache: Path, seconds: float, motion: str
) -> dict[str, Any]:
    """Lets the page move something, as often as a mouse reports, and looks at what the user gets."""
    page.evaluate("() => { viewer.picture.latencies = []; }")
    shown, kernels = page.evaluate("() => viewer.picture.shown"), len(list(cache.iterdir()))
    used = seconds_of(tracer), seconds_of(browser)
    began = time.perf_counter()
    page.evaluate(f"() => {{ let number = 0; window.motion = setInterval({motion}, {REPORT}); }}")
    headers: list[dict[str, Any]] = []
    while time.perf_counter() - began < seconds:
        time.sleep(0.25)
        headers.append(page.evaluate("() => viewer.picture.header"))
    elapsed = time.perf_counter() - began
    frames = page.evaluate("() => viewer.picture.shown") - shown
    page.evaluate("() => clearInterval(window.motion)")
    return {
        "frames/s": round(frames / elapsed, 1),
        "median ms from input to picture": round(median(page.evaluate("() => viewer.picture.latencies"))),
        "median ms to render": round(1000 * median(header["seconds"]["render"] for header in headers)),
        "median ms to compress": round(1000 * median(header["seconds"]["compress"] for header in headers), 1),
        "median ms to unpack and draw": round(median(page.evaluate("() => viewer.picture.drawing")), 1),
        "median columns": median(header["width"] for header in headers),
        "tracer's processor seconds a second": round((seconds_of(tracer) - used[0]) / elapsed, 2),
        "browser's": round((seconds_of(browser) - used[1]) / elapsed, 2),
        "kernels compiled": len(list(cache.iterdir())) - kernels,
    }


DRAG = """() => {
  const box = viewer.picture.canvas.getBoundingClientRect();
  number += 1;
  viewer.picture.canvas.dispatchEvent(new PointerEvent("pointermove", {
    clientX: box.x + box.width / 2 + 150 * Math.sin(number / 60),
    clientY: box.y + box.height / 2 + 20 * Math.sin(number / 45),
  }));
}"""
"""Orbits, to and fro, once the button is down."""

SLIDE = """() => {
  const sliders = document.querySelectorAll("[data-control]");
  const range = sliders[Math.floor(number / 40) % sliders.length];
  range.value = Math.abs(number % 40 - 20) * 50;
  range.dispatchEvent(new Event("input"));
  number += 1;
}"""
"""Moves every slider to its end and back, one after the other."""


def grip(page: Any) -> None:
    """Presses the button over the middle of the picture."""
    box = page.locator("#picture").bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()


CHANGE = "([kind, values]) => viewer.link.change(kind, values)"
LAYERS = ("color", "rays", "shape")
CHOICES = ("cube", "rabbit")
CUTOFFS = (0.05, 0.03, 0.011)


def visit(page: Any, choices: Sequence[str]) -> None:
    """Shows everything once that has kernels of its own and that `wander` goes to: they stay in memory."""
    for answers in product((False, True), repeat=len(choices)):
        for name, value in zip(choices, answers, strict=True):
            page.evaluate(CHANGE, ["choose", {"name": name, "value": value}])
        for layer, cutoff in product(LAYERS, CUTOFFS):
            page.evaluate(CHANGE, ["show", {"layer": layer}])
            page.evaluate(CHANGE, ["set", {"name": "cutoff", "value": cutoff}])
            page.wait_for_timeout(100)
            page.wait_for_function(AT_REST, timeout=120_000)


def wander(page: Any, choices: Sequence[str], seed: int) -> Callable[[], None]:
    """Whatever a user may do, at random."""
    chance = random.Random(seed)
    controls = page.evaluate("() => viewer.panel.controls")

    def step() -> None:
        kind = chance.randrange(100)
        if kind < 40:
            angles = {"left": chance.uniform(-5, 5), "up": chance.uniform(-2, 2)}
            page.evaluate(CHANGE, ["orbit", angles])
        elif kind < 85:
            control = chance.choice(controls)
            value = chance.uniform(control["low"], control["high"])
            page.evaluate(CHANGE, ["set", {"name": control["name"], "value": value}])
        elif kind < 90:
            place = {"kind": "look", "x": chance.random(), "y": chance.random()}
            page.evaluate("(place) => viewer.link.send(place)", place)
        elif kind < 93:
            page.evaluate(CHANGE, ["show", {"layer": chance.choice(LAYERS)}])
        elif kind < 96 and choices:
            answer = {"name": chance.choice(choices), "value": chance.random() < 0.5}
            page.evaluate(CHANGE, ["choose", answer])
        elif kind < 99:
            page.evaluate("() => viewer.link.gesture()")
            page.evaluate(CHANGE, [chance.choice(("undo", "undo", "reset")), {}])
        else:
            page.wait_for_timeout(1500)  # the picture is sharpened

    return step


def leaked(page: Any, tracer: int, seconds: float, seed: int) -> dict[str, Any]:
    """The memory of the tracer's process and of the page over random interaction, and where it leads."""
    choices = [name for name in CHOICES if page.locator(f'input[name="choice-{name}"]').count()]
    start = megabytes_of(tracer)
    visit(page, choices)
    step = wander(page, choices, seed)
    curve: list[tuple[float, float, float]] = []
    began, number = time.perf_counter(), 0
    while (now := time.perf_counter() - began) < seconds:
        step()
        number += 1
        if not curve or now - curve[-1][0] > 1:
            heap = page.evaluate("() => performance.memory.usedJSHeapSize") / 2**20
            curve.append((now, megabytes_of(tracer), heap))
        time.sleep(0.01)
    late = np.array([row for row in curve if row[0] > WARM_UP * seconds])
    slope = np.polyfit(late[:, 0], late[:, 1], 1)[0]
    return {
        "actions": number,
        "tracer MiB at first": round(start),
        "when everything was shown once": round(curve[0][1]),
        "after the warm-up": round(float(late[0, 1])),
        "at the end": round(float(late[-1, 1])),
        "MiB a minute after the warm-up": round(60 * float(slope), 2),
        "two hours would add MiB": round(7200 * float(slope)),
        "page's heap MiB, median at the end": round(float(np.median(late[len(late) // 2 :, 2])), 1),
    }


@click.command()
@click.option("--scene", default="classic", show_default=True)
@click.option("--resolution", type=int, nargs=2, default=(640, 480), show_default=True)
@click.option("--seconds", default=15.0, show_default=True, help="Of each measurement but the last.")
@click.option(
    "--wander", "wandering", default=120.0, show_default=True, help="Seconds of random interaction."
)
@click.option("--seed", default=1, show_default=True)
def main(scene: str, resolution: tuple[int, int], seconds: float, wandering: float, seed: int) -> None:
    """Print what was measured, as JSON."""
    found: dict[str, Any] = {"scene": scene, "resolution": resolution}
    with tempfile.TemporaryDirectory() as folder:
        cache = Path(folder)
        with opened(scene, resolution, cache) as (page, tracer, browser):
            found["kernels of the first picture"] = len(list(cache.iterdir()))
            grip(page)
            found["orbit"] = measured(page, tracer, browser, cache, seconds, DRAG)
            page.mouse.up()
            page.wait_for_timeout(3000)
            found["sliders"] = measured(page, tracer, browser, cache, seconds, SLIDE)
            if wandering:
                found["random interaction"] = leaked(page, tracer, wandering, seed)
    click.echo(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
