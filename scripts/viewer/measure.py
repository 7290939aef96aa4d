"""A viewer with its page in a headless browser, and what is measured of both."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from scripts.viewer.motions import AT_REST, wander
from scripts.viewer.processes import megabytes_of, processes_below, seconds_of

BROWSERS = ("chromium", "chromium-browser", "google-chrome")

REPORT = 10
"""Milliseconds from one report of the mouse to the next."""

WARM_UP = 1 / 2
"""Share of the random interaction that the memory curve leaves out: caches fill first."""


STRETCHES, STUDENT = 12, 2.228
"""Parts of the curve that count as independent, and the quantile of Student's t for two fewer."""


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


def leaked(page: Any, tracer: int, seconds: float, seed: int) -> dict[str, Any]:
    """The memory of the tracer's process and of the page over random interaction, and where it leads."""
    step = wander(page, seed)
    curve: list[tuple[float, float, float]] = []
    began, number = time.perf_counter(), 0
    while (now := time.perf_counter() - began) < seconds:
        step()
        number += 1
        if not curve or now - curve[-1][0] > 1:
            heap = page.evaluate("() => performance.memory.usedJSHeapSize") / 2**20
            curve.append((now, megabytes_of(tracer), heap))
        time.sleep(0.01)
    memory = np.array(curve)
    late = memory[memory[:, 0] > WARM_UP * seconds]
    slope, doubt = slope_of(late[:, 0], late[:, 1])
    return {
        "actions": number,
        "tracer MiB at first": round(curve[0][1]),
        "mean of each tenth": [round(float(part.mean())) for part in np.array_split(memory[:, 1], 10)],
        "largest": round(float(memory[:, 1].max())),
        "two hours would add MiB": [round(7200 * slope), round(7200 * doubt)],
        "page's heap MiB, median at the end": round(float(np.median(late[len(late) // 2 :, 2])), 1),
    }


def slope_of(seconds: np.ndarray, values: np.ndarray) -> tuple[float, float]:
    """Slope of a curve (n,), and the half width of its 95 % interval; from the means of stretches, since what
    is measured from one second to the next is not independent."""
    x, y = (np.array([part.mean() for part in np.array_split(a, STRETCHES)]) for a in (seconds, values))
    slope, rest = np.polyfit(x, y, 1)
    variance = np.sum((y - slope * x - rest) ** 2) / (STRETCHES - 2)
    return float(slope), float(STUDENT * np.sqrt(variance / np.sum((x - x.mean()) ** 2)))
