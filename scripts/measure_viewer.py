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
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any

import click
import numpy as np

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
TICKS = os.sysconf("SC_CLK_TCK")
AT_REST = "() => window.viewer?.picture?.header?.final"
WARM_UP = 1 / 3
"""Share of the random interaction that the memory curve leaves out: caches and kernels come first."""


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
    page: Any, tracer: int, browser: int, cache: Path, seconds: float, step: Callable[[int], None]
) -> dict[str, Any]:
    """Does something again and again, as quickly as a mouse reports, and looks at what the user gets."""
    page.evaluate("() => { viewer.picture.latencies = []; }")
    shown, kernels = page.evaluate("() => viewer.picture.shown"), len(list(cache.iterdir()))
    used = seconds_of(tracer), seconds_of(browser)
    began, number = time.perf_counter(), 0
    rendering: list[float] = []
    sizes: list[int] = []
    while time.perf_counter() - began < seconds:
        step(number)
        number += 1
        header = page.evaluate("() => viewer.picture.header")
        rendering.append(header["seconds"]["render"])
        sizes.append(header["width"])
        time.sleep(0.012)
    elapsed = time.perf_counter() - began
    return {
        "frames/s": round((page.evaluate("() => viewer.picture.shown") - shown) / elapsed, 1),
        "median ms from input to picture": round(median(page.evaluate("() => viewer.picture.latencies"))),
        "median ms to render": round(1000 * median(rendering)),
        "median columns": median(sizes),
        "tracer's processor seconds a second": round((seconds_of(tracer) - used[0]) / elapsed, 2),
        "browser's": round((seconds_of(browser) - used[1]) / elapsed, 2),
        "kernels compiled": len(list(cache.iterdir())) - kernels,
    }


def drag(page: Any) -> Callable[[int], None]:
    """Orbits, to and fro."""
    box = page.locator("#picture").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    return lambda number: page.mouse.move(x + 120 * np.sin(number / 40), y + 20 * np.sin(number / 25))


def slide(page: Any) -> Callable[[int], None]:
    """Moves every slider from end to end, one after the other."""
    names = page.evaluate(
        "() => [...document.querySelectorAll('[data-control]')].map(r => r.dataset.control)"
    )
    script = """([name, step]) => {
      const range = document.querySelector(`[data-control="${CSS.escape(name)}"]`);
      range.value = step;
      range.dispatchEvent(new Event('input'));
    }"""
    return lambda number: page.evaluate(script, [names[number // 8 % len(names)], number % 8 * 1000 / 7])


def wander(page: Any, seed: int) -> Callable[[int], None]:
    """Whatever a user may do, at random."""
    chance = random.Random(seed)
    move, change = slide(page), "([kind, values]) => viewer.link.change(kind, values)"
    choices = page.evaluate(
        "() => [...document.querySelectorAll('.choice input')].map(i => [i.name, i.value])"
    )
    layers = page.evaluate("() => [...document.querySelectorAll('#layer option')].map(o => o.value)")

    def step(number: int) -> None:
        kind = chance.randrange(100)
        if kind < 40:
            angles = {"left": chance.uniform(-5, 5), "up": chance.uniform(-2, 2)}
            page.evaluate(change, ["orbit", angles])
        elif kind < 85:
            move(chance.randrange(8000))
        elif kind < 90:
            page.evaluate(
                "(place) => viewer.link.send({kind: 'look', ...place})",
                {"x": chance.random(), "y": chance.random()},
            )
        elif kind < 93:
            page.evaluate(change, ["show", {"layer": chance.choice(layers)}])
        elif kind < 96 and choices:
            name, value = chance.choice(choices)
            page.evaluate(change, ["choose", {"name": name.removeprefix("choice-"), "value": value == "1"}])
        else:
            page.evaluate("() => viewer.link.gesture()")
            page.evaluate(change, [chance.choice(("undo", "undo", "reset")), {}])

    return step


def leaked(page: Any, tracer: int, seconds: float, step: Callable[[int], None]) -> dict[str, Any]:
    """The memory of the tracer's process and of the page over random interaction, and where it leads."""
    curve: list[tuple[float, float, float]] = []
    began, number = time.perf_counter(), 0
    while (now := time.perf_counter() - began) < seconds:
        step(number)
        number += 1
        if not curve or now - curve[-1][0] > 1:
            heap = page.evaluate("() => performance.memory.usedJSHeapSize") / 2**20
            curve.append((now, megabytes_of(tracer), heap))
        time.sleep(0.01)
    late = np.array([row for row in curve if row[0] > WARM_UP * seconds])
    slope = np.polyfit(late[:, 0], late[:, 1], 1)[0]
    return {
        "actions": number,
        "tracer MiB at first": round(curve[0][1]),
        "after the warm-up": round(float(late[0, 1])),
        "at the end": round(float(late[-1, 1])),
        "MiB a minute after the warm-up": round(60 * float(slope), 2),
        "two hours would add MiB": round(7200 * float(slope)),
        "page's heap MiB, median of the last third": round(float(np.median(late[len(late) // 2 :, 2])), 1),
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
            found["orbit"] = measured(page, tracer, browser, cache, seconds, drag(page))
            page.mouse.up()
            page.wait_for_timeout(3000)
            found["sliders"] = measured(page, tracer, browser, cache, seconds, slide(page))
            if wandering:
                found["random interaction"] = leaked(page, tracer, wandering, wander(page, seed))
    click.echo(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
