"""Errors as users see them: one sentence on stderr, and the exit code that belongs to it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from typing import TypeVar

import click

from tracer.cli.interruption import Interruption
from tracer.errors import MachineError, TracerError

Job = TypeVar("Job")

BAD_INPUT = 2
BUG = 70  # EX_SOFTWARE of sysexits.h
BROKEN_PIPE = 141  # 128 + SIGPIPE, as for any program whose reader went away


def report(error: BaseException) -> int:
    """Says on stderr what went wrong and returns the exit code."""
    text, code = explain(error)
    talk(f"error: {text}")
    if code == BUG and os.environ.get("TRACER_TRACEBACK"):
        raise error
    return code


def worst_of(jobs: Iterable[Job], do: Callable[[Job], int], interruption: Interruption) -> int:
    """Does one job after the other; one that fails is reported and does not stop the rest. Returns the worst
    exit code."""
    worst = 0
    for job in jobs:
        try:
            worst = max(worst, do(job))
        except Exception as error:
            interruption.check()
            worst = max(worst, report(error))
        interruption.check()
    return worst


def talk(text: str) -> None:
    """One line on stderr that says who speaks."""
    click.echo(f"tracer: {' '.join(text.splitlines())}", err=True)


def explain(error: BaseException) -> tuple[str, int]:
    """The sentence and the exit code of an error."""
    if isinstance(error, TracerError):
        return str(error), error.exit_code
    if isinstance(error, click.ClickException):
        return error.format_message(), BAD_INPUT
    if isinstance(error, MemoryError) or "out of memory" in str(error):
        remedy = "a smaller --scale, --resolution or --crop needs less"
        return f"there is not enough memory ({error or 'no details'}); {remedy}", MachineError.exit_code
    if isinstance(error, OSError):
        where = f"{error.filename}: " if error.filename else ""
        return f"{where}{error.strerror or error}", BAD_INPUT
    what = f"{type(error).__name__}: {error}"
    return f"unexpected {what} (a fault of tracer itself; TRACER_TRACEBACK=1 shows where)", BUG
