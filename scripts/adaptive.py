"""What adaptive supersampling saves and misses, against the full grid: `python scripts/adaptive.py`.

Prints the table of docs/adaptive.md: shares of the pixels, and of the rays and the time of the full grid. The
two pictures of a line are rendered in turn, and the least of their times counts, scene tables included.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np

import tracer

SCENES = ("classic", "room", "classic_rabbit", "light_disk")
WIDTH = 1280


CLOCKS = {"time": time.perf_counter, "processor time": time.process_time}
"""The latter is that of all threads together: it says more where the machine has other work as well."""


def line(name: str, n: int, threshold: float, repeat: int) -> str:
    """One line of the table."""
    scene = tracer.load(name)
    scene.camera.supersample = n
    ways: dict[str, dict[str, Any]] = {
        "full": {},
        "adaptive": {"supersample": "adaptive", "threshold": threshold},
    }
    seconds = {clock: dict.fromkeys(ways, float("inf")) for clock in CLOCKS}
    results: dict[str, tracer.Result] = {}
    for _ in range(repeat + 1):  # the first time compiles kernels
        for way, settings in ways.items():
            started = {clock: now() for clock, now in CLOCKS.items()}
            results[way] = tracer.render(scene, scale=WIDTH / scene.camera.resolution[0], **settings)
            for clock, now in CLOCKS.items():
                seconds[clock][way] = min(seconds[clock][way], now() - started[clock])
    full, adaptive = (np.clip(results[way].color, 0, 1) for way in ways)
    within = (np.abs(full - adaptive).max(axis=2) <= 1 / 255).mean()
    refined = results["adaptive"].stats["refined_pixels"] / results["adaptive"].depth.size
    rays = {way: float(sum(result.stats["rays"].values())) for way, result in results.items()}
    shares = [refined, *(taken["adaptive"] / taken["full"] for taken in (rays, *seconds.values()))]
    cells = [
        f"`{name}`",
        f"{n} × {n}",
        f"{threshold}",
        f"{100 * within:.2f} %",
        *(f"{100 * share:.0f} %" for share in shares),
        f"{seconds['time']['full']:.2f} s",
    ]
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description="Adaptive supersampling against the full grid, as a table.")
    parser.add_argument("--scene", action="append", help="repeatable")
    parser.add_argument("--grid", type=int, action="append", help="n of n x n, repeatable")
    parser.add_argument("--threshold", type=float, action="append", help="repeatable")
    parser.add_argument("--repeat", type=int, default=5, help="pairs of pictures that are timed")
    options = parser.parse_args()
    heads = ("scene", "grid", "threshold", "within 1/255", "refined", "rays", *CLOCKS, "full grid takes")
    print(f"| {' | '.join(heads)} |\n{'|---' * len(heads)}|")
    for name in options.scene or SCENES:
        for n in options.grid or (3, 4):
            for threshold in options.threshold or (0.015,):
                print(line(name, n, threshold, options.repeat), flush=True)


if __name__ == "__main__":
    main()
