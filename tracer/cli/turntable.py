"""`tracer turntable`: the camera goes once around a scene."""

from __future__ import annotations

import math
from typing import Any

import click

from tracer.cli.interruption import Interruption
from tracer.cli.options import animation_options, picture_options, scene_options

MOST_FRAMES = 1_000_000


def _finite(
    _: click.Context, __: click.Parameter, point: tuple[float, float, float] | None
) -> tuple[float, float, float] | None:
    """The point; NaN and infinity are bad usage."""
    for number in point or ():
        if not math.isfinite(number):
            raise click.BadParameter(f"{number} is not a finite number.")
    return point


@click.command(short_help="Render a movie from around a scene.")
@click.argument("scene")
@click.option(
    "--frames",
    type=click.IntRange(1, MOST_FRAMES),
    default=120,
    show_default=True,
    metavar="N",
    help="Frames of a full turn.",
)
@click.option(
    "--around",
    type=float,
    nargs=3,
    callback=_finite,
    metavar="X Y Z",
    help="The point in the middle.  [default: see above]",
)
@animation_options
@picture_options
@scene_options
@click.pass_obj
def turntable(
    interruption: Interruption,
    scene: str,
    frames: int,
    around: tuple[float, float, float] | None,
    fps: float,
    **options: Any,
) -> int:
    """Render SCENE from all sides: the camera goes once around it, in N even steps, as NAME.mp4.

    A camera with a `target` goes around it, about its `up`. The camera in the canvas form goes around the
    middle of all spheres and meshes, about the y axis, which points up; it takes its canvas with it, and what
    lies before the canvas is cut away. Frame 1 is the scene as it stands; the last one is followed by the
    first again. What the scene keys over time ([[animation]]) moves as well.

    \b
    Examples:
      tracer turntable classic
      tracer turntable my.toml --frames 240 --fps 60 -o turn.webm
      tracer turntable room -o '{name}.{frame:04d}.png' -o '{name}.gif' --scale 0.25

    -o names movies (NAME.mp4 without -o) and numbered pictures. Ctrl-C finishes the band in hand, and
    --resume goes on with the next one; the frames of a movie are kept in NAME.frames until it is written.
    """
    from tracer.cli.animation import render_animations
    from tracer.cli.animation_job import Course, View
    from tracer.cli.wishes import Wishes
    from tracer.scene import Scene
    from tracer.turntable import middle_of, turned

    def view_of(loaded: Scene) -> View:
        middle = around or middle_of(loaded.at(1))

        def at(frame: int) -> Scene:
            return turned(loaded.at(frame), 360 * (frame - 1) / frames, middle)

        return View(at, f"{frames} frames around {middle}")

    course = Course(range(1, frames + 1), fps)
    return render_animations((scene,), Wishes(**options), course, view_of, "{name}.mp4", interruption)
