"""`tracer export`: a scene for another renderer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from tracer.cli.failures import talk
from tracer.cli.options import scene_options

SUFFIXES = {"mitsuba": ".xml", "povray": ".pov"}


@click.command("export", short_help="Write a scene for another renderer.")
@click.argument("scene")
@click.option(
    "--to", "renderer", type=click.Choice(tuple(SUFFIXES)), required=True, help="The other renderer."
)
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    help="The file, .xml or .pov; what it names goes beside it. {name} is the scene's name.  "
    "[default: {name}.xml or {name}.pov]",
)
@click.option("--scale", type=float, default=1.0, metavar="S", help="Size against the scene's resolution.")
@scene_options
def export(
    scene: str,
    renderer: str,
    output: str | None,
    scale: float,
    overrides: tuple[str, ...],
    allow_outside: bool,
) -> None:
    """Write SCENE, a .toml file or a built-in name, for another renderer.

    Geometry and camera are the same there. Lights and materials are as near as that renderer comes; what has
    no counterpart is said here and at the top of the file.

    \b
    Examples:
      tracer export classic --to mitsuba -o classic.xml
      mitsuba -m llvm_ad_rgb -Dspp=256 classic.xml
      tracer export room --to povray -o room.pov
      povray +Iroom.pov +W1024 +H1024 -A
    """
    from tracer.film.atomic import check_writable, fill_template
    from tracer.scene import load
    from tracer.settings import Settings, picture_canvas

    settings = Settings(scale=scale).checked()
    loaded = load(scene, allow_outside=allow_outside, overrides=overrides)
    suffix = SUFFIXES[renderer]
    file = fill_template(output or "{name}" + suffix, loaded.name)
    check_writable(file, (suffix,))
    exported = writer_of(renderer)(loaded, file, picture_canvas(loaded, settings))
    for remark in exported.remarks:
        talk(f"{loaded.name}: {remark}")
    click.echo(", ".join([file, *(piece.name for piece in exported.pieces)]))


def writer_of(renderer: str) -> Callable[..., Any]:
    """What writes a scene for that renderer: a function of scene, file and canvas."""
    if renderer == "povray":
        from reference.povray.document import export_povray

        return export_povray
    from reference.mitsuba_xml import export_mitsuba

    return export_mitsuba
