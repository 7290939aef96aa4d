"""Options that several commands share."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, TypeVar

import click

from tracer.cli.progress import KINDS

LARGEST_SIDE = 65535

Command = TypeVar("Command", bound=Callable[..., Any])


threads_option = click.option(
    "--threads", type=click.IntRange(1, 1024), metavar="N", help="CPU threads.  [default: all cores]"
)


def backend_option(text: str) -> Callable[[Command], Command]:
    """`--backend`, with what its help says."""
    kinds = click.Choice(("auto", "llvm", "cuda"))
    return click.option("--backend", type=kinds, default="auto", show_default=True, help=text)


class Size(click.ParamType):
    """A number of bytes such as 2G, 500M, 1.5GiB."""

    name = "size"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Bytes; K, M, G and T are powers of 1024."""
        found = re.fullmatch(r"(\d+(?:\.\d*)?)([KMGT]?)(?:i?B)?", str(value).strip(), re.IGNORECASE)
        if found is None:
            self.fail(f"{value!r} is no size; allowed: a number and K, M, G or T, such as 2G", param, ctx)
        return int(float(found.group(1)) * 1024 ** " KMGT".index(found.group(2).upper() or " "))


class SubRays(click.ParamType):
    """A number of sub-rays in each direction, or `adaptive`."""

    name = "sub-rays"
    _numbers = click.IntRange(1, 64)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The number, or the word."""
        if value == "adaptive":
            return value
        if not re.fullmatch(r"[+-]?\d+", str(value).strip(), re.ASCII):
            self.fail(f"{value!r} is no number; allowed: 1 to 64, or adaptive", param, ctx)
        return self._numbers.convert(value, param, ctx)


def scene_options(command: Command) -> Command:
    """`--set` and `--allow-outside`: how a scene is loaded."""
    command = click.option(
        "--allow-outside",
        is_flag=True,
        help="Let the scene use files outside its own folder and the assets folder.",
    )(command)
    return click.option(
        "--set",
        "overrides",
        multiple=True,
        metavar="KEY=VALUE",
        help="Set a value of the scene, e.g. camera.fov=40, shapes.3.radius=2. Repeatable.",
    )(command)


def animation_options(command: Command) -> Command:
    """`--fps`: how an animation is rendered."""
    return click.option(
        "--fps",
        type=click.FloatRange(0.1, 1000),
        default=30.0,
        show_default=True,
        metavar="N",
        help="Frames a second of a movie.",
    )(command)


def report_options(folder: str, what: str) -> Callable[[Command], Command]:
    """`--out`, `--json` and `--summary` of a command that writes a page; `what`: how it calls that page."""

    def add(command: Command) -> Command:
        command = click.option(
            "--summary", type=click.Path(), metavar="FILE", help="Write a summary in Markdown."
        )(command)
        command = click.option(
            "--json", "json_file", type=click.Path(), metavar="FILE", help="Write the numbers here as well."
        )(command)
        return click.option(
            "--out",
            type=click.Path(),
            default=folder,
            show_default=True,
            metavar="DIR",
            help=f"Folder of the {what}: index.html and index.json.",
        )(command)

    return add


def picture_options(command: Command) -> Command:
    """Where pictures go, how large and exact they are, and what is told about them; see `Wishes`."""
    for option in reversed(_PICTURE_OPTIONS):
        command = option(command)
    return command


_PICTURE_OPTIONS = (
    click.option(
        "-o",
        "--output",
        "outputs",
        multiple=True,
        metavar="FILE",
        help="A .png, .exr or .npz file; of frames also .mp4, .webm or .gif. {name} is the scene's name. "
        "Repeatable.  [default: {name}.png; of a turntable {name}.mp4]",
    ),
    click.option(
        "--scale", type=float, default=1.0, metavar="S", help="Size against the scene's resolution."
    ),
    click.option(
        "--resolution",
        type=click.IntRange(1, LARGEST_SIDE),
        nargs=2,
        metavar="W H",
        help="Size in pixels; the vertical extent of the canvas stays.",
    ),
    click.option(
        "--supersample",
        type=SubRays(),
        metavar="N",
        help="N x N rays a pixel; adaptive: those of the scene, or 3 x 3, where neighbors differ, else one.",
    ),
    click.option(
        "--threshold",
        type=float,
        metavar="T",
        help="By how much they differ for --supersample adaptive, 0 to 1.  [default: 0.015]",
    ),
    click.option(
        "--crop", type=int, nargs=4, metavar="X0 Y0 X1 Y1", help="Only these pixels, end exclusive."
    ),
    click.option(
        "--precision",
        type=click.Choice(("single", "double")),
        default="single",
        show_default=True,
        help="Arithmetic.",
    ),
    backend_option("Processor."),
    threads_option,
    click.option(
        "--memory",
        type=Size(),
        metavar="SIZE",
        help="What the process may take, e.g. 2G or 500M.  [default: what the machine has]",
    ),
    click.option(
        "--aov",
        "aovs",
        multiple=True,
        metavar="NAME",
        help="A layer for .exr and .npz, or `all`. Repeatable.",
    ),
    click.option(
        "--aov-png",
        is_flag=True,
        help="Each layer in false colors, as NAME.LAYER.png; the depth without --aov.",
    ),
    click.option(
        "--bits", type=click.Choice(("8", "16")), default="8", show_default=True, help="Bits of a PNG."
    ),
    click.option("--alpha", is_flag=True, help="Coverage as a fourth channel of a PNG."),
    click.option("--half", is_flag=True, help="16-bit color in OpenEXR."),
    click.option(
        "--seed", type=click.IntRange(0, 2**63 - 1), metavar="N", help="Seed of jitter and depth of field."
    ),
    click.option(
        "--resume", is_flag=True, help="Go on with what an earlier run of the same command finished."
    ),
    click.option(
        "--stats",
        is_flag=True,
        help="Tell where the time went, rays by kind, hits by shape, kernels, memory; also in "
        "NAME.stats.json.",
    ),
    click.option("--quiet", is_flag=True, help="Print nothing but errors (and what --stats asks for)."),
    click.option(
        "--progress",
        type=click.Choice(KINDS),
        default="auto",
        show_default=True,
        help="On stderr; auto: bar on a terminal; json: an object a line.",
    ),
)
