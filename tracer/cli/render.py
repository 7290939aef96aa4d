"""`tracer render`: scenes to pictures."""

from __future__ import annotations

from typing import Any

import click

from tracer.cli.interruption import Interruption
from tracer.cli.options import picture_options, scene_options


@click.command(short_help="Render scenes to pictures.")
@click.argument("scenes", nargs=-1, required=True, metavar="SCENE...")
@picture_options
@scene_options
@click.pass_obj
def render(interruption: Interruption, scenes: tuple[str, ...], **options: Any) -> int:
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

    Ctrl-C keeps the finished rows in NAME.partial.png; a second one quits at once.
    """
    from tracer.cli.pictures import Wishes, render_scenes

    return render_scenes(scenes, Wishes(**options), interruption)
