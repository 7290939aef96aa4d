"""What a run of the benchmark holds: every time as it was taken, medians and minima beside it."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

PEERS = {"tracer": "tracer", "mitsuba": "Mitsuba 3", "povray": "POV-Ray"}
"""The renderers, by key, in the order of tables."""


@dataclass(frozen=True)
class Series:
    """Seconds of one thing, in the order in which they were taken."""

    seconds: tuple[float, ...]

    @property
    def median(self) -> float:
        """NaN where nothing was taken."""
        return statistics.median(self.seconds) if self.seconds else float("nan")

    @property
    def least(self) -> float:
        """NaN where nothing was taken."""
        return min(self.seconds, default=float("nan"))

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"median": self.median, "least": self.least, "seconds": list(self.seconds)}


@dataclass(frozen=True)
class Frame:
    """One picture by one peer.

    `trace`: from rays to colors; `whole`: what a user waits for (tracer: the scene made anew, once, and the
    call of `render`; Mitsuba: the same with its frame; POV-Ray: its process). `rays` by kind; `differing`:
    share of the pixels that differ from tracer's by more than 2/255, NaN for tracer itself.
    """

    peer: str
    trace: Series
    whole: Series
    rays: Mapping[str, int] = field(default_factory=dict)
    differing: float = float("nan")


@dataclass(frozen=True)
class Process:
    """One peer in processes of their own. Seconds: `first`, of the first frame with an empty kernel cache;
    `warm`, of the first frame of a second process, which finds the kernels of the first; `later`, of another
    frame; `process` and `warm_process`, from the start of both up to their first frame; NaN where there are
    no kernels. `peak`: the most memory that the first one held, in MiB."""

    peer: str
    first: float
    warm: float
    later: float
    process: float
    warm_process: float
    peak: float


@dataclass(frozen=True)
class Point:
    """One picture by all peers: `name` of the scene or place on a curve, `x` where the curve has it."""

    name: str
    x: float
    pixels: int
    frames: tuple[Frame, ...]
    processes: tuple[Process, ...] = ()

    def frame(self, peer: str) -> Frame | None:
        """The frame of one peer."""
        return next((frame for frame in self.frames if frame.peer == peer), None)

    def ratio(self, peer: str, least: bool = False) -> float:
        """How many times as long as tracer a peer traces, by medians or minima; NaN where one is missing."""
        ours, theirs = self.frame("tracer"), self.frame(peer)
        if ours is None or theirs is None or not ours.trace.seconds:
            return float("nan")
        return theirs.trace.least / ours.trace.least if least else theirs.trace.median / ours.trace.median


@dataclass(frozen=True)
class Group:
    """Points that belong together: the scenes, or a curve over `axis`."""

    name: str
    title: str
    axis: str
    points: tuple[Point, ...]

    @property
    def peers(self) -> list[str]:
        """Who rendered any of them, in the order of tables."""
        return [peer for peer in PEERS if any(point.frame(peer) for point in self.points)]

    @property
    def kinds(self) -> list[str]:
        """The kinds of rays that were counted."""
        frames = [frame for point in self.points for frame in point.frames]
        return list(dict.fromkeys(kind for frame in frames for kind in frame.rays))


@dataclass(frozen=True)
class Rate:
    """Rays of one kind on one mesh: how many were traced and hit something, and the time they took."""

    mesh: str
    kind: str
    peer: str
    rays: int
    hits: int
    time: Series

    @property
    def per_second(self) -> float:
        """Rays a second, by the median."""
        return self.rays / self.time.median


@dataclass(frozen=True)
class Build:
    """From a mesh file to something that rays can be traced in: reading it, and the hierarchy over it."""

    mesh: str
    triangles: int
    peer: str
    read: Series
    build: Series


@dataclass(frozen=True)
class Benchmark:
    """A whole run."""

    header: Mapping[str, str]
    groups: tuple[Group, ...]
    rates: tuple[Rate, ...]
    builds: tuple[Build, ...]
    notes: Sequence[str] = ()
