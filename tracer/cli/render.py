"""`tracer render`: scenes to pictures."""

from __future__ import annotations

from typing import Any

import click

from tracer.cli.interruption import Interruption
from tracer.cli.options import animation_options, picture_options, scene_options
from tracer.errors import UsageError


@click.command(short_help="Render scenes to pictures.")
@click.argument("scenes", nargs=-1, required=True, metavar="SCENE...")
@click.option(
    "--frames",
    metavar="A:B[:STEP]",
    help="The frames A to B of the scene's [[animation]], B included, as NAME.0001.png or a movie.",
)
@animation_options
@picture_options
@scene_options
@click.option(
    "--pixel",
    type=int,
    nargs=2,
    metavar="X Y",
    help="Print the tree of rays of a pixel instead of rendering.",
)
@click.option("--json", "as_json", is_flag=True, help="With --pixel: print the tree as JSON.")
@click.pass_obj
def render(
    interruption: Interruption,
    scenes: tuple[str, ...],
    frames: str | None,
    fps: float,
    pixel: tuple[int, int] | None,
    as_json: bool,
    **options: Any,
) -> int:
    """Render each SCENE, a .toml file or a built-in name (see `tracer scenes`).

    Everything is checked before the first ray is traced. Of several scenes a bad one is left out, and the
    worst exit code is returned. Each picture ends with a line on stdout: its files, its size, the seconds
    from the scene file to the written picture, and the rays a second while tracing (the first time for a
    kind of scene this includes the compilation of its kernel).

    \b
    Examples:
      tracer render room
      tracer render room --scale 0.25 -o small.png
      tracer render a.toml b.toml -o out/{name}.png -o out/{name}.exr --aov all
      tracer render room --set lights.0.weight=1 --set 'shapes."left ball".radius=90'
      tracer render room --precision double --supersample 4 --bits 16
      tracer render room --pixel 300 200

    What a picture has finished is kept in NAME.work until the picture is written. Ctrl-C finishes the band in
    hand and writes NAME.partial.png; a second one quits at once. The same command with --resume goes on, also
    after a crash or a full disk, and ends with the same bytes.

    With --frames, -o names numbered pictures (a name without {frame} gets .0001 and so on) and movies: .mp4,
    .webm or .gif. Ctrl-C finishes the band in hand, and --resume goes on with the next one.

    \b
      tracer render my.toml --frames 1:240 -o out/{name}.{frame:04d}.exr -o {name}.mp4
    """
    from tracer.cli.wishes import Wishes, warn

    wishes = Wishes(**options)
    if pixel is not None:
        from tracer.cli.pixel import show_pixels

        if frames is not None:
            raise UsageError("--pixel: shows one picture; leave out --frames")
        return show_pixels(scenes, pixel, wishes, as_json)
    if as_json:
        raise UsageError("--json: shows the rays of a pixel; allowed: with --pixel")
    if frames is None:
        from tracer.cli.pictures import render_scenes
        from tracer.film.movie import is_movie

        for output in filter(is_movie, wishes.outputs):
            what = "is the name of a movie, which takes --frames, such as --frames 1:120"
            raise UsageError(f"{output}: {what}")
        return render_scenes(scenes, wishes, interruption)

    from tracer.cli.animation import render_animations
    from tracer.cli.animation_job import Course, View
    from tracer.cli.frame_names import read_frames
    from tracer.scene import Scene

    def animated(scene: Scene) -> View:
        if not scene.animation:
            warn(f"{scene.name}: has no [[animation]], so that all frames are the same", wishes)
        return View(scene.at, "as the scene says")

    course = Course(read_frames(frames), fps)
    return render_animations(scenes, wishes, course, animated, "{name}.png", interruption)
