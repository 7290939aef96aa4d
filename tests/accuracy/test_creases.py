"""Rays that start close to an edge which two faces share: no false hit, and no contact lost in a crease."""

from __future__ import annotations

import pytest

from tests.accuracy.wedge import try_wedge

ANGLES = (5, 30, 60, 90, 120, 150, 170, 175, 179, 180, 181, 200, 270, 330)


def check(degrees: float, trials: int, rays: int, offset: float, precision: str = "single") -> None:
    tally = try_wedge(degrees, trials, rays, offset, precision)
    assert tally.rays > 0.3 * 4 * trials * rays * (0.5 if degrees < 30 or degrees > 330 else 1)
    wrong = (tally.false_hits, tally.lost, tally.shadows)
    assert wrong == (0, 0, 0), f"{wrong} false hits, lost, wrong shadows of {tally.rays}: {tally.example}"


@pytest.mark.parametrize("degrees", ANGLES)
def test_crease_in_single_precision(degrees: float) -> None:
    """4 x 2,500 rays from 1e-7 to 1e-1 of the size from the edge, both faces, both sides, any winding and
    cut."""
    check(degrees, trials=1, rays=2500, offset=3)


@pytest.mark.slow
@pytest.mark.parametrize("offset", [0.1, 300])
@pytest.mark.parametrize("degrees", ANGLES)
def test_many_creases_in_single_precision(degrees: float, offset: float) -> None:
    check(degrees, trials=3, rays=20_000, offset=offset)


@pytest.mark.parametrize("degrees", [60, 180, 270])
def test_crease_in_double_precision(degrees: float) -> None:
    check(degrees, trials=1, rays=2500, offset=3, precision="double")
