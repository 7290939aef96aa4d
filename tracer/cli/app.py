"""The command `tracer`, and how every command ends: at worst with one sentence on stderr and an exit code."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

import click

from tracer.cli.bench import bench
from tracer.cli.classic import classic
from tracer.cli.compare import compare
from tracer.cli.doctor import doctor
from tracer.cli.export import export
from tracer.cli.failures import BROKEN_PIPE, report
from tracer.cli.info import info
from tracer.cli.interruption import Interruption
from tracer.cli.render import render
from tracer.cli.scenes import scenes
from tracer.cli.turntable import turntable
from tracer.cli.validate import validate
from tracer.cli.view import view
from tracer.version import __version__


@click.group(
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Exit codes: 0 done; 1 a comparison failed; 2 bad usage or bad input; "
    "3 the machine lacks something; 130 interrupted.",
)
@click.version_option(__version__, prog_name="tracer", message="%(prog)s %(version)s")
@click.pass_context
def cli(context: click.Context) -> None:
    """A Whitted ray tracer, vectorized with Dr.Jit.

    \b
    Examples:
      tracer scenes                          what is built in
      tracer render room                     writes room.png
      tracer classic                         asks six questions, writes classic.png
      tracer render my.toml -o out/{name}.png -o out/{name}.exr
      tracer render --help                   all options
    """
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


for _command in (render, turntable, view, classic, scenes, info, compare, validate, bench, export, doctor):
    cli.add_command(_command)


def run(arguments: Sequence[str]) -> int:
    """Runs one command line and returns the exit code."""
    _write_every_character()
    if "_TRACER_COMPLETE" in os.environ:  # the shell asks for completions; click answers and exits
        cli.main(prog_name="tracer")
    with Interruption() as interruption:
        try:
            with cli.make_context("tracer", list(arguments), obj=interruption) as context:
                code = cli.invoke(context)
            if sys.stdout is not None:  # closed by whoever started the command
                sys.stdout.flush()
            return code or 0
        except click.exceptions.Exit as end:
            return end.exit_code
        except KeyboardInterrupt:
            return interruption.exit_code
        except BrokenPipeError:
            return _without_reader()
        except Exception as error:
            return interruption.exit_code if interruption.requested else report(error)


def _write_every_character() -> None:
    """A file name that the terminal's encoding lacks is shown escaped instead of ending the command."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def _without_reader() -> int:
    """Ends quietly when nobody reads on, as in `tracer scenes | head -1`."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for descriptor in (1, 2):  # or Python complains once more when it closes them
        os.dup2(nowhere, descriptor)
    return BROKEN_PIPE
