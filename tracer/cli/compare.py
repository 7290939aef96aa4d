"""`tracer compare`: how far two pictures are apart."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from tracer.compare import Comparison


def _not_nan(_: click.Context, __: click.Parameter, value: float) -> float:
    if math.isnan(value):
        raise click.BadParameter("nan is not a number from 0 on.")
    return value


@click.command(short_help="Compare two pictures.")
@click.argument("a", type=click.Path())
@click.argument("b", type=click.Path())
@click.option(
    "--out", type=click.Path(), metavar="FILE", help="Write the difference as a PNG, its largest value white."
)
@click.option(
    "--tolerance",
    type=click.FloatRange(min=0),
    default=0.0,
    show_default=True,
    callback=_not_nan,
    help="Largest difference of display values (0 to 1) that passes.",
)
def compare(a: str, b: str, out: str | None, tolerance: float) -> int:
    """Compare the pictures A and B (.png, .jpg, .exr, .npz).

    Prints the largest difference, the root of the mean square and CIEDE2000. Exit code 1 when a display value
    differs by more than the tolerance; 2 when the sizes differ.

    \b
    Examples:
      tracer compare before.png after.png
      tracer compare a.exr b.exr --tolerance 1e-4 --out difference.png
    """
    from tracer.compare import compare_pictures, write_difference
    from tracer.film.atomic import check_writable
    from tracer.film.result import load_picture_file

    if out is not None:
        check_writable(out, (".png",))
    first, second = load_picture_file(a), load_picture_file(b)
    found = compare_pictures(first, second, tolerance)
    click.echo(format_comparison(found, tolerance))
    if out is not None:
        write_difference(out, first, second)
        click.echo(f"difference    {out}")
    return 1 if found.maximum > tolerance else 0


def format_comparison(found: Comparison, tolerance: float) -> str:
    """The report for a terminal."""
    place = "" if found.position is None else f"  at column {found.position[0]}, row {found.position[1]}"
    return "\n".join(
        (
            f"maximum       {found.maximum:.6g}{place}",
            f"RMS           {found.rms:.6g}",
            f"CIEDE2000     mean {found.delta_e_mean:.4g}, maximum {found.delta_e_max:.4g}",
            f"pixels        {found.differing} of {found.pixels} differ by more than {tolerance:g}",
        )
    )
