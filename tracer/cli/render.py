"""`tracer render`: scenes to pictures."""

from __future__ import annotations

from typing import Any

import click

from tracer.cli.interruption import Interruption
from tracer.cli.options import scene_options
from tracer.cli.progress import KINDS

LARGEST_SIDE = 65535


@click.command(short_help="Render scenes to pictures.")
@click.argument("scenes", nargs=-1, required=True, metavar="SCENE...")
@click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    metavar="FILE",
    help="A .png, .exr or .npz file; {name} is the scene's name. Repeatable.  [default: {name}.png]",
)
@scene_options
@click.option("--scale", type=float, default=1.0, metavar="S", help="Size against the scene's resolution.")
@click.option(
    "--resolution",
    type=click.IntRange(1, LARGEST_SIDE),
    nargs=2,
    metavar="W H",
    help="Size in pixels; the vertical extent of the canvas stays.",
)
@click.option("--supersample", type=click.IntRange(1, 64), metavar="N", help="N x N rays a pixel.")
@click.option("--crop", type=int, nargs=4, metavar="X0 Y0 X1 Y1", help="Only these pixels, end exclusive.")
@click.option(
    "--precision",
    type=click.Choice(("single", "double")),
    default="single",
    show_default=True,
    help="Arithmetic.",
)
@click.option(
    "--backend",
    type=click.Choice(("auto", "llvm", "cuda")),
    default="auto",
    show_default=True,
    help="Processor.",
)
@click.option(
    "--threads", type=click.IntRange(1, 1024), metavar="N", help="CPU threads.  [default: all cores]"
)
@click.option(
    "--aov", "aovs", multiple=True, metavar="NAME", help="A layer for .exr and .npz, or `all`. Repeatable."
)
@click.option("--bits", type=click.Choice(("8", "16")), default="8", show_default=True, help="Bits of a PNG.")
@click.option("--alpha", is_flag=True, help="Coverage as a fourth channel of a PNG.")
@click.option("--half", is_flag=True, help="16-bit color in OpenEXR.")
@click.option(
    "--seed", type=click.IntRange(0, 2**63 - 1), metavar="N", help="Seed of jitter and depth of field."
)
@click.option("--stats", is_flag=True, help="Tell where the time went, rays by kind, kernels, memory.")
@click.option("--quiet", is_flag=True, help="Print nothing but errors (and what --stats asks for).")
@click.option(
    "--progress",
    type=click.Choice(KINDS),
    default="auto",
    show_default=True,
    help="On stderr; auto: bar on a terminal.",
)
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
