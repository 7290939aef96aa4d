"""`python -m scripts.viewer`: how quick the live viewer is at the browser, and what it keeps.

Starts `tracer view` with a kernel cache of its own and drives its page in a headless browser on the same
machine, as tests do. Linux: memory and time of processes are read from /proc.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import click

from scripts.viewer.measure import leaked, measured, opened
from scripts.viewer.motions import DRAG, SLIDE, grip


@click.command()
@click.option("--scene", default="classic", show_default=True)
@click.option("--resolution", type=int, nargs=2, default=(640, 480), show_default=True)
@click.option("--seconds", default=15.0, show_default=True, help="Of each measurement but the last.")
@click.option(
    "--wander",
    "wandering",
    type=click.FloatRange(min=120),
    default=120.0,
    show_default=True,
    help="Seconds of random interaction.",
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
            found["random interaction"] = leaked(page, tracer, wandering, seed)
    click.echo(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
