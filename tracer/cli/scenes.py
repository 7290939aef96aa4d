"""`tracer scenes`: the built-in scenes."""

from __future__ import annotations

from pathlib import Path

import click


@click.command(short_help="List the built-in scenes.")
def scenes() -> None:
    """List the built-in scenes: the name for `tracer render NAME`, and what it shows."""
    from tracer.assets import SCENES, builtin_scenes
    from tracer.errors import MachineError

    found = builtin_scenes()
    if not found:
        raise MachineError(f"{SCENES}: there are no built-in scenes; the installation is incomplete")
    width = max(map(len, found))
    for name, path in found.items():
        click.echo(f"{name:<{width}}  {first_comment(path)}".rstrip())


def first_comment(path: Path) -> str:
    """The first line of comment of a scene file; empty where it does not start with one."""
    with path.open(encoding="utf-8", errors="replace") as lines:
        for line in lines:
            if line.strip():
                return line.strip().lstrip("#").strip() if line.startswith("#") else ""
    return ""
