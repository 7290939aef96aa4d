"""What is compared, and what came out: terms, outcomes, and the rays that replay the differences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

import tracer

if TYPE_CHECKING:
    from reference.comparison.case import Case

Guilty = Literal["", "ours", "mitsuba", "both", "unknown", "cuda", "llvm"]


@dataclass(frozen=True)
class Replay:
    """One ray and what both tracers say of it. `origin`, `direction`: as both were given them; `ours`,
    `mitsuba`, `truth`: answers in words; `command`: what shows it again; `pixel`: column and row, None for a
    ray of no pixel; `in_band`: it may differ, since rounding decides."""

    origin: list[float]
    direction: list[float]
    ours: str
    mitsuba: str
    truth: str
    command: str
    pixel: tuple[int, int] | None = None
    in_band: bool = False

    def __str__(self) -> str:
        return (
            f"ray {self.origin} -> {self.direction}: ours {self.ours}; Mitsuba {self.mitsuba}; "
            f"extended precision {self.truth}; replay: {self.command}"
        )


@dataclass(frozen=True)
class Growth:
    """Free-running chains at one vertex: how many are left, median and 99 % of the distance between the two
    tracers' vertices in S, and medians in units of eps S times the gain of the bounces so far: `scaled` of
    that distance, `ours` and `mitsuba` of the distance from the chain of extended precision, each in eps of
    its own."""

    vertex: int
    chains: int
    median: float
    most: float
    scaled: float
    ours: float
    mitsuba: float


ULP_EDGES = np.concatenate([[0.0], 2.0 ** np.arange(-6, 25)])
"""Borders of the bins of `Spectrum`, in ulp; what is larger counts in the last bin."""


@dataclass(frozen=True)
class Spectrum:
    """How many rays have an error of how many ulp: counts between `ULP_EDGES`, of our side (ulp of its own
    precision) and of Mitsuba's (ulp of single precision), against extended precision."""

    ours: np.ndarray
    mitsuba: np.ndarray

    @staticmethod
    def of(ours: np.ndarray, mitsuba: np.ndarray) -> Spectrum:
        """The counts of errors (n,) in ulp."""
        counts = (np.histogram(np.minimum(e, ULP_EDGES[-1]), ULP_EDGES)[0] for e in (ours, mitsuba))
        return Spectrum(*counts)


@dataclass(frozen=True)
class Panels:
    """The same picture by both sides. `kind`: "color" (h, w, 3) display values or "depth" (h, w), -1 blank;
    `differs` (h, w): pixels that are counted as different, all of them near a place where rounding decides if
    the term passed."""

    kind: Literal["color", "depth"]
    ours: np.ndarray
    mitsuba: np.ndarray
    differs: np.ndarray


@dataclass(frozen=True)
class Outcome:
    """One term on one scene in one precision.

    `rays` compared; `excluded`: rays that differ in the grazing band (for numbers: rays left out since they
    graze what they hit), at most `excluded_allowed`; `measured`,
    `allowed`: the largest difference between the two tracers in `unit` (for ids and masks: how many differ
    outside the band); `ours_error`, `mitsuba_error`: against extended precision, each in units of its own
    precision, with their bounds, NaN where there is no closed form; `guilty`: who broke a bound; `samples`:
    differences of some rays, with `distance_to_silhouette` in eps S of single precision; `worst`: the ray to
    look at; `differing`: rays that hit or see something else on both sides, as many as are listed; `spectrum`
    of errors in ulp, for distances, normals and directions; `growth`: for chains; `panels`: for pictures;
    `figures`: other numbers by name, such as color differences.
    """

    term: str
    scene: str
    precision: str
    backend: str
    rays: int
    measured: float
    allowed: float
    unit: str
    excluded: int = 0
    excluded_allowed: int = 0
    ours_error: float = float("nan")
    ours_allowed: float = float("nan")
    mitsuba_error: float = float("nan")
    mitsuba_allowed: float = float("nan")
    guilty: Guilty = ""
    worst: Replay | None = None
    samples: np.ndarray = field(default_factory=lambda: np.zeros(0))
    distance_to_silhouette: np.ndarray = field(default_factory=lambda: np.zeros(0))
    differing: tuple[Replay, ...] = ()
    spectrum: Spectrum | None = None
    growth: tuple[Growth, ...] = ()
    panels: Panels | None = None
    figures: dict[str, float] = field(default_factory=dict)

    @property
    def margin(self) -> float:
        """How many times the measured difference fits into what is allowed; infinite when there is none."""
        return self.allowed / self.measured if self.measured else float("inf")

    @property
    def passed(self) -> bool:
        """Whether every bound holds."""
        return (
            self.measured <= self.allowed
            and self.excluded <= self.excluded_allowed
            and not self.ours_error > self.ours_allowed
            and not self.mitsuba_error > self.mitsuba_allowed
        )

    @property
    def verdict(self) -> str:
        """`passed`, `failed`, or `no rays` where nothing was met that could be compared."""
        if self.passed and not self.rays:
            return "no rays"
        return "passed" if self.passed else "failed"

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, strings and lists for JSON; what is not finite becomes None; no pictures."""
        table = asdict(replace(self, panels=None)) | {
            "margin": self.margin,
            "verdict": self.verdict,
        }
        del table["panels"]
        return {key: _plain(value) for key, value in table.items()}

    def __str__(self) -> str:
        text = (
            f"{self.term}, {self.scene}, {self.precision}: {self.verdict}; measured {self.measured:.3g}, "
            f"allowed {self.allowed:.3g} {self.unit}; {self.rays} rays, {self.excluded} left to "
            f"the grazing band (allowed {self.excluded_allowed}); errors: ours {self.ours_error:.3g} "
            f"(allowed {self.ours_allowed:.3g}), Mitsuba {self.mitsuba_error:.3g} "
            f"(allowed {self.mitsuba_allowed:.3g})"
        )
        guilty = f"; guilty: {self.guilty}" if self.guilty else ""
        return f"{text}{guilty}" + (f"; {self.worst}" if self.worst else "")


@dataclass(frozen=True)
class Term:
    """One comparison. `compares`: in words; `applies`: whether a scene has what it needs; `run`: does it;
    `precisions`: in which it makes sense."""

    name: str
    compares: str
    applies: Callable[[tracer.Scene], bool]
    run: Callable[[Case], Outcome]
    precisions: tuple[str, ...] = ("single", "double")

    def suits(self, scene: tracer.Scene, precision: str) -> bool:
        """Whether there is something to compare."""
        return precision in self.precisions and self.applies(scene)


@dataclass(frozen=True)
class Validation:
    """A whole run. `header`: with what it was made, name and value in the order of a report, the command that
    repeats it among them; `outcomes`: all of them; `notes`: sentences on what was left out, and why."""

    header: dict[str, str]
    outcomes: tuple[Outcome, ...]
    notes: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether every outcome did."""
        return all(outcome.passed for outcome in self.outcomes)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value
