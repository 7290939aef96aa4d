"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

Command = TypeVar("Command", bound=Callable[..., Any])


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
