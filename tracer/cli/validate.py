"""`tracer validate`: the tracer against Mitsuba and closed forms, ray by ray."""

from __future__ import annotations

import shlex
import sys
from typing import TYPE_CHECKING, Any

import click

from tracer.cli.failures import talk
from tracer.cli.interruption import Interruption
from tracer.cli.options import backend_option, report_options, scene_options, threads_option
from tracer.cli.progress import KINDS, make_reporter

if TYPE_CHECKING:
    from reference.comparison import Outcome
    from reference.session import Request

PRECISIONS = {"single": ("single",), "double": ("double",), "both": ("single", "double")}


@click.command(short_help="Compare with Mitsuba 3 and with closed forms, ray by ray.")
@click.argument("scenes", nargs=-1, metavar="[SCENE]...")
@click.option("--full", is_flag=True, help="All built-in scenes and 16 random ones, ten times the rays.")
@click.option(
    "--random", type=click.IntRange(0, 10_000), metavar="N", help="N random scenes, beside those named."
)
@click.option(
    "--seed",
    type=click.IntRange(0, 2**31 - 1),
    default=0,
    show_default=True,
    metavar="S",
    help="Number of the first random scene; also decides which rays are compared.",
)
@click.option(
    "--rays",
    type=click.IntRange(100, 10_000_000),
    metavar="N",
    help="Rays a scene.  [default: 20000, with --full 200000]",
)
@click.option("--term", "terms", multiple=True, metavar="NAME", help="Only this comparison. Repeatable.")
@click.option(
    "--precision",
    type=click.Choice(tuple(PRECISIONS)),
    default="both",
    show_default=True,
    help="Our arithmetic; Mitsuba always has single precision.",
)
@backend_option("Our processor; Mitsuba stays on LLVM.")
@threads_option
@report_options("reports/crossvalidation", "report")
@click.option(
    "--headline",
    type=click.Path(),
    metavar="FILE",
    help="Rewrite the headline numbers between the marks in a Markdown file.",
)
@click.option("--pixel", type=int, nargs=2, metavar="X Y", help="Only show this pixel's ray, side by side.")
@click.option(
    "--ray", type=float, nargs=6, metavar="OX OY OZ DX DY DZ", help="Only show this ray, side by side."
)
@click.option(
    "--events", metavar="LETTERS", help="For a ray that is shown: its chain, R mirror, T refraction."
)
@click.option("--quiet", is_flag=True, help="Print nothing but what failed.")
@click.option("--progress", type=click.Choice(KINDS), default="auto", show_default=True, help="On stderr.")
@scene_options
@click.pass_obj
def validate(interruption: Interruption, scenes: tuple[str, ...], **options: Any) -> int:
    """Compare each SCENE, a .toml file or a built-in name, with Mitsuba 3 and with closed forms in extended
    precision, and write a report. Without a SCENE: a standard set.

    Outside a stated band around silhouettes, edges and the like no ray may differ, and no number may be
    farther off than its conditioning allows. Exit code 1 when a tolerance is broken.

    \b
    Examples:
      tracer validate                                  a standard set, within a minute
      tracer validate --full                           everything
      tracer validate my.toml --out report
      tracer validate --random 20 --seed 100
      tracer validate room --pixel 250 300             one pixel, vertex by vertex
    """
    request = request_of(scenes, **options)
    if any(options[name] is not None for name in ("pixel", "ray", "events")):
        return show_ray(request, options["pixel"], options["ray"], options["events"])
    return compare(request, interruption, **options)


def request_of(scenes: tuple[str, ...], **options: Any) -> Request:
    """What is to be compared; raises `MachineError` where the extra is not installed."""
    from reference.mitsuba_variant import mitsuba
    from tracer.errors import MachineError

    mitsuba()
    try:
        from reference.session import Request
    except ModuleNotFoundError as error:
        raise MachineError(
            f"{error.name} is not installed; `pip install whitted-tracer[reference]` installs all that "
            "`tracer validate` needs"
        ) from error
    names = ("full", "random", "seed", "rays", "terms", "backend", "overrides", "allow_outside")
    return Request(
        scenes=scenes,
        precisions=PRECISIONS[options["precision"]],
        command=shlex.join(["tracer", *sys.argv[1:]]),
        **{name: options[name] for name in names},
    )


def compare(request: Request, interruption: Interruption, **options: Any) -> int:
    """Runs the comparison and writes the files; the exit code."""
    from reference import session
    from tracer.backends import thread_count

    interruption.quiet = quiet = options["quiet"]
    files = session.Files(options["out"], options["json_file"], options["summary"], options["headline"])
    request.find_terms()
    subjects, _ = request.subjects(), request.processor
    files.check()
    reporter = make_reporter("none" if quiet and options["progress"] == "auto" else options["progress"], "")
    done: list[Outcome] = []
    stopped: list[str] = []

    def progress(count: int, total: int, outcome: Outcome) -> None:
        done.append(outcome)
        reporter.update(count, total, sum(each.rays for each in done))
        stopped[:] = [f"The run was stopped after {count} of {total} comparisons."]
        interruption.check()

    try:
        with thread_count(options["threads"]), interruption.deferred():
            session.compare(request, subjects, progress)
    except KeyboardInterrupt:
        page = files.write_partial(session.validation_of(request, done, stopped))
        talk(f"{interruption.reason}: {page} holds what was finished")
        raise
    finally:
        reporter.close()
    written = files.write(session.validation_of(request, done))
    return tell(done, written, quiet)


def tell(outcomes: list[Outcome], written: list[str], quiet: bool) -> int:
    """Says what failed, and where the report is; the exit code."""
    failures = [outcome for outcome in outcomes if not outcome.passed]
    for failure in failures:
        click.echo(f"failed: {failure}")
    if not quiet:
        met = [outcome for outcome in outcomes if outcome.rays]
        verdict = f"{len(failures)} of {len(met)} failed" if failures else f"all {len(met)} passed"
        scenes, rays = len({outcome.scene for outcome in met}), sum(outcome.rays for outcome in met)
        empty = f"; {len(outcomes) - len(met)} met no ray" if len(met) < len(outcomes) else ""
        click.echo(f"{verdict}: {scenes} scenes, {rays:,} comparisons of a ray{empty}")
        click.echo(", ".join(written))
    return 1 if failures else 0


def show_ray(
    request: Request,
    pixel: tuple[int, int] | None,
    ray: tuple[float, ...] | None,
    events: str | None,
) -> int:
    """Prints what all sides say of one ray."""
    from reference.comparison import Case
    from reference.comparison.replay import free_ray, pixel_colors, pixel_ray, replay_ray
    from reference.comparison.replay_text import color_text, replay_text
    from tracer.errors import UsageError

    if (pixel is None) == (ray is None):
        raise UsageError("--pixel, --ray, --events: one of --pixel and --ray is needed to show a ray")
    wrong = sorted(set(events or "") - {"R", "T"})
    if wrong:
        raise UsageError(f"--events: {events!r} contains {wrong[0]!r}; allowed are the letters R and T")
    subjects = request.subjects() if request.scenes or request.random else []
    if len(subjects) != 1:
        raise UsageError(f"--pixel and --ray show a ray of one scene; {len(subjects)} are named")
    case = Case(subjects[0].scene, backend=request.processor, seed=request.seed)
    start = pixel_ray(case, *pixel) if pixel is not None else free_ray(ray or ())
    vertices = replay_ray(case, start, events)
    click.echo(replay_text(case.scene, vertices, start.o[0].tolist(), start.d[0].tolist()))
    if pixel is not None and events is None:
        click.echo("\n" + color_text(pixel_colors(case, *pixel)))
    return 0
