"""Outcomes made up for the tests of the report."""

from __future__ import annotations

from typing import Any

import numpy as np

from reference.comparison.records import ULP_EDGES, Growth, Outcome, Panels, Replay, Spectrum, Validation

COMMAND = "tracer validate room --rays 1000"
HEADER = {"date": "2026-01-02 03:04 UTC", "tracer": "0.1.0", "command to repeat": COMMAND}


def replay(in_band: bool, **changes: Any) -> Replay:
    """A ray that both sides answer differently."""
    given: dict[str, Any] = {
        "origin": [0.0, 1.0, 2.0],
        "direction": [0.0, 0.0, 1.0],
        "ours": "hits shape 3, primitive 0",
        "mitsuba": "misses",
        "truth": "hits shape 3, primitive 0",
        "command": f"{COMMAND} --pixel 4 5",
        "pixel": (4, 5),
    }
    return Replay(**{**given, "in_band": in_band, **changes})


def distances(scene: str = "room", precision: str = "single", **changes: Any) -> Outcome:
    """A term of numbers that passes: 2 of 16 allowed, errors 2 of 16 and 3 of 8."""
    rng = np.random.default_rng(0)
    counts = rng.integers(0, 50, len(ULP_EDGES) - 1) * (np.arange(len(ULP_EDGES) - 1) < 10)
    given: dict[str, Any] = {
        "term": "distance, plane",
        "rays": 1000,
        "measured": 2.0,
        "allowed": 16.0,
        "unit": "eps S / cos",
        "ours_error": 2.0,
        "ours_allowed": 16.0,
        "mitsuba_error": 3.0,
        "mitsuba_allowed": 8.0,
        "samples": rng.random(200),
        "distance_to_silhouette": np.append(10.0 ** rng.uniform(0, 7, 199), np.inf),
        "spectrum": Spectrum(counts, counts[::-1].copy()),
    }
    return Outcome(**{**given, "scene": scene, "precision": precision, "backend": "llvm", **changes})


def hits(scene: str = "room", precision: str = "single", **changes: Any) -> Outcome:
    """A term of questions that passes: of 1000 answers one differs in the band."""
    given: dict[str, Any] = {
        "term": "hits",
        "rays": 1000,
        "measured": 0.0,
        "allowed": 0.0,
        "unit": "rays",
        "excluded": 1,
        "excluded_allowed": 4,
        "differing": (replay(in_band=True),),
    }
    return Outcome(**{**given, "scene": scene, "precision": precision, "backend": "llvm", **changes})


def picture(scene: str = "room", kind: str = "color", **changes: Any) -> Outcome:
    """A term with pictures of 24 x 16 pixels, half of which differ by a 1e-5, and one by more."""
    rng = np.random.default_rng(1)
    shape = (16, 24, 3) if kind == "color" else (16, 24)
    ours = rng.uniform(0.1, 0.9, shape) + (0 if kind == "color" else 3)
    mitsuba = ours + np.where(rng.random(shape) < 0.5, 1e-5, 0)
    differs = np.zeros((16, 24), bool)
    differs[5, 4] = True
    mitsuba[5, 4] = -1 if kind == "depth" else 0
    given: dict[str, Any] = {
        "term": "picture" if kind == "color" else "depth buffer, mask",
        "rays": 384,
        "measured": 1e-5,
        "allowed": 1e-4,
        "unit": "display value",
        "panels": Panels(kind, ours, mitsuba, differs),  # type: ignore[arg-type]
        "figures": {"ΔE2000 mean": 1e-3, "ΔE2000 max": 0.5} if kind == "color" else {},
    }
    return Outcome(**{**given, "scene": scene, "precision": "single", "backend": "llvm", **changes})


def chains(scene: str = "room", **changes: Any) -> Outcome:
    """Chains whose differences grow threefold a vertex."""
    growth = tuple(Growth(v, 1000 // v, 1e-8 * 3.0**v, 1e-6 * 3.0**v, 0.5, 0.3, 0.4) for v in range(1, 6))
    return distances(scene, term="chain growth", spectrum=None, growth=growth, **changes)


def run_of(*outcomes: Outcome, notes: tuple[str, ...] = ("A scene was left out.",)) -> Validation:
    """A whole run."""
    return Validation(dict(HEADER), outcomes, notes)


def failing_run() -> Validation:
    """Two scenes with everything that a page shows; hits fail in the second one, and Mitsuba is guilty."""
    worst = replay(in_band=False, command=f"{COMMAND} --pixel 7 8", pixel=(7, 8))
    return run_of(
        *(distances(precision=name) for name in ("single", "double")),
        *(hits(precision=name) for name in ("single", "double")),
        picture(),
        picture(kind="depth"),
        chains(),
        distances("other"),
        picture("other"),
        hits("other", measured=2.0, guilty="mitsuba", worst=worst, excluded=0),
    )
