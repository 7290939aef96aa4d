"""`tracer classic`: the document's six questions, and the room that they ask for."""

from __future__ import annotations

from typing import Any

import click

from tracer.cli.interruption import Interruption
from tracer.cli.options import picture_options, scene_options
from tracer.cli.questions import choices


@click.command(short_help="Ask the document's six questions and render the answer.")
@click.option(
    "--wallpaper",
    type=click.Choice(("fox", "trees")),
    help="The picture on the back wall.  [answer 1; default: trees]",
)
@click.option(
    "--texture-3d/--no-texture-3d",
    default=None,
    help="The picture laid through the marble ball, or one plain color.  [answer 2; default: yes]",
)
@click.option("--tetrahedron/--no-tetrahedron", default=None, help="[answer 3; default: yes]")
@click.option(
    "--cube/--no-cube",
    default=None,
    help="Without it, the golden ball lies on the floor.  [answer 4; default: yes]",
)
@click.option("--rabbit/--no-rabbit", default=None, help="On a shelf.  [answer 5; default: no]")
@click.option(
    "--rotate/--no-rotate", default=None, help="The view turned by 20 degrees.  [answer 6; default: no]"
)
@click.option("--save", type=click.Path(), metavar="SCENE.toml", help="Write the scene that was asked for.")
@picture_options
@scene_options
@click.pass_obj
def classic(
    interruption: Interruption,
    wallpaper: str | None,
    texture_3d: bool | None,
    tetrahedron: bool | None,
    cube: bool | None,
    rabbit: bool | None,
    rotate: bool | None,
    save: str | None,
    **options: Any,
) -> int:
    """Ask the six questions of the document's program and render the room, as classic.png.

    A question whose option is given is not asked. At a terminal, Enter takes the default; a pipe or a file
    holds up to six answers, 0 or 1, separated by white space, in the order below: an option wins over the
    answer in its place, missing answers take the default, and what follows the sixth is ignored. With the six
    options nothing is read.

    \b
    Examples:
      tracer classic
      tracer classic --wallpaper fox --rabbit --scale 0.5 -o fox.png
      echo 0 1 1 0 1 0 | tracer classic
      tracer classic --rotate --save mine.toml < /dev/null
    """
    trees = None if wallpaper is None else wallpaper == "trees"
    chosen = choices(
        {
            "trees": trees,
            "texture_3d": texture_3d,
            "tetrahedron": tetrahedron,
            "cube": cube,
            "rabbit": rabbit,
            "rotate": rotate,
        }
    )

    from tracer.cli.classic_room import load_room
    from tracer.cli.pictures import render_scenes
    from tracer.cli.wishes import Wishes
    from tracer.film.atomic import check_writable
    from tracer.scene import Scene

    wishes = Wishes(**options)
    if save is not None:
        check_writable(save, (".toml",))

    def load_chosen(_: str) -> Scene:
        room = load_room(chosen, wishes.overrides, wishes.allow_outside)
        if save is not None:
            room.save(save)
        return room

    return render_scenes(("classic",), wishes, interruption, load_chosen)
