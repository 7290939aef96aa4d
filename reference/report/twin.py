"""The report for programs: every number of a run as JSON."""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from math import isfinite
from typing import Any

from reference.comparison.records import ULP_EDGES, Outcome, Validation
from reference.report.headline import Headline
from reference.tolerances import TOLERANCES
from tracer.film.atomic import atomic_write

SAMPLED = ("samples", "distance_to_silhouette")
SAMPLE_DIGITS = 4
"""Samples are for drawing; in full length they would be nine tenths of the file."""


def write_json(path: str | os.PathLike[str], validation: Validation) -> None:
    """Header, verdict, headline, tolerances, all outcomes but for pictures, and notes.

    What is not finite is null; samples have four digits. Raises OutputError.
    """
    table = {
        "header": validation.header,
        "passed": validation.passed,
        "headline": _finite(asdict(Headline.of(validation))),
        "tolerances": [{"name": name, **row._asdict()} for name, row in TOLERANCES.items()],
        "ulp_edges": ULP_EDGES.tolist(),
        "outcomes": [_outcome(outcome) for outcome in validation.outcomes],
        "notes": list(validation.notes),
    }
    text = json.dumps(table, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    with atomic_write(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def _outcome(outcome: Outcome) -> dict[str, Any]:
    table = outcome.to_dict()
    for key in SAMPLED:
        table[key] = [None if value is None else float(f"{value:.{SAMPLE_DIGITS}g}") for value in table[key]]
    return table


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    return None if isinstance(value, float) and not isfinite(value) else value
