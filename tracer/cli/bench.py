"""`tracer bench`: speed and memory next to Mitsuba and POV-Ray, in one run."""

from __future__ import annotations

import shlex
import sys
from typing import TYPE_CHECKING, Any

import click

from tracer.cli.failures import talk
from tracer.cli.interruption import Interruption
from tracer.cli.options import report_options, threads_option
from tracer.cli.progress import KINDS, make_reporter

if TYPE_CHECKING:
    from reference.bench.plan import Step
    from reference.bench.session import Request


@click.command(short_help="Measure speed and memory next to other renderers.")
@click.option(
    "--quick", "full", flag_value=False, default=False, help="The short set, under two minutes (default)."
)
@click.option("--full", "full", flag_value=True, help="All scenes, curves and meshes, about half an hour.")
@click.option("--scene", "scenes", multiple=True, metavar="SCENE", help="Only this scene. Repeatable.")
@click.option("--only", multiple=True, metavar="PART", help="Only this part of the set. Repeatable.")
@threads_option
@click.option(
    "--repeat", type=click.IntRange(1, 1000), metavar="N", help="Rounds.  [default: 5, with --full 9]"
)
@click.option(
    "--pixels",
    type=click.IntRange(8, 16384),
    metavar="N",
    help="Pixels across the pictures, at most.  [default: 512, with --full 1024]",
)
@report_options("reports/benchmark", "page")
@click.option("--quiet", is_flag=True, help="Print no table.")
@click.option("--progress", type=click.Choice(KINDS), default="auto", show_default=True, help="On stderr.")
@click.pass_obj
def bench(interruption: Interruption, scenes: tuple[str, ...], **options: Any) -> None:
    """Render the same pictures by tracer, by Mitsuba 3 (Embree) and by POV-Ray, in turn, and write a page of
    times, ratios, rays a second and memory. A renderer that is not installed is left out.

    \b
    A SCENE is room, room-3k, room-82k, room-330k, room-1.3M (with a mesh of so many
    triangles), mirrors-82k, spheres, a .toml file or a built-in name. A PART is scenes, pixels,
    triangles, lights, recursion, threads, queries or builds.

    \b
    Examples:
      tracer bench                                  the short set
      tracer bench --full --summary bench.md        everything
      tracer bench --scene room --repeat 20 --out room
      tracer bench --only queries --only builds
    """
    request = request_of(scenes, **options)
    measure(request, interruption, **options)


def request_of(scenes: tuple[str, ...], **options: Any) -> Request:
    """What is to be measured; raises `MachineError` where the extra is not installed."""
    from tracer.doctor import cores
    from tracer.errors import MachineError

    try:
        from reference.bench.session import Request
    except ImportError as error:
        raise MachineError(
            f"{error.name} is not installed; `pip install whitted-tracer[reference]` installs all that "
            "`tracer bench` needs"
        ) from error
    return Request(
        full=options["full"],
        scenes=scenes,
        only=options["only"],
        threads=options["threads"] or cores(),
        repeat=options["repeat"],
        pixels=options["pixels"],
        command=shlex.join(["tracer", *sys.argv[1:]]),
    )


def measure(request: Request, interruption: Interruption, **options: Any) -> None:
    """Runs the set and writes the files."""
    from reference.bench import session
    from reference.bench.report import table_of

    interruption.quiet = quiet = options["quiet"]
    files = session.Files(options["out"], options["json_file"], options["summary"])
    files.check()
    reporter = make_reporter("none" if quiet and options["progress"] == "auto" else options["progress"], "")

    def progress(done: float, total: float, step: Step) -> None:
        reporter.update(round(done), round(total), 0)

    try:
        with interruption.deferred():
            found = session.run(request, progress, interruption.check)
    except KeyboardInterrupt:
        talk(f"{interruption.reason}: nothing was written")
        raise
    finally:
        reporter.close()
    written = files.write(found)
    if not quiet:
        for note in found.notes:
            talk(note)
        click.echo(table_of(found))
        click.echo(", ".join(written))
