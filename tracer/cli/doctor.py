"""`tracer doctor`: what this machine has and lacks."""

from __future__ import annotations

import json

import click

from tracer.errors import MachineError


@click.command(short_help="Tell what this machine has, what it lacks, and what mends it.")
@click.option("--json", "as_json", is_flag=True, help="Print the report as JSON.")
def doctor(as_json: bool) -> int:
    """Tell versions, backends, the LLVM in use, what is missing and the command that mends it.

    Exit code 3 when something is missing without which nothing renders.
    """
    from tracer.doctor import diagnose, format_report

    found = diagnose()
    click.echo(json.dumps(found, indent=2) if as_json else format_report(found))
    return MachineError.exit_code if any(gap["required"] for gap in found["missing"]) else 0
