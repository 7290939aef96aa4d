"""What the page shows of one scene: pictures, drawings, and the rays that are answered differently."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape

from markupsafe import Markup
from matplotlib.figure import Figure

from reference.comparison.records import Outcome, Replay
from reference.report import svg
from reference.report.bounds import failures_first
from reference.report.growth import draw_growth
from reference.report.numbers import number
from reference.report.pictures import Trio, thumbnail, trio_of
from reference.report.ridges import draw_ridges
from reference.report.scatter import draw_scatter

LISTED = 40
"""Differing rays that a scene lists, at most; the JSON file has them all."""


@dataclass(frozen=True)
class Pictures:
    """A row of three pictures with the outcome that they belong to."""

    outcome: Outcome
    trio: Trio
    figures: str


@dataclass(frozen=True)
class Listed:
    """A differing ray with the outcome that it belongs to."""

    outcome: Outcome
    replay: Replay


@dataclass(frozen=True)
class Section:
    """A scene. `anchor` is what links lead to; `unlisted` rays differ but are not in `rays`."""

    anchor: str
    scene: str
    outcomes: list[Outcome]
    failed: list[Outcome]
    pictures: list[Pictures]
    rays: list[Listed]
    unlisted: int
    thumbnail: str = ""
    ridges: Markup | None = None
    scatter: Markup | None = None
    growth: Markup | None = None

    @property
    def inside(self) -> int:
        """How many rays differ in the grazing band."""
        return sum(outcome.excluded for outcome in self.outcomes)


def sections_of(outcomes: tuple[Outcome, ...]) -> list[Section]:
    """A section a scene, in the order of the run."""
    groups: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        groups.setdefault(outcome.scene, []).append(outcome)
    with svg.style():
        return [_section(f"scene-{place + 1}", *group) for place, group in enumerate(groups.items())]


def _section(anchor: str, scene: str, outcomes: list[Outcome]) -> Section:
    rays = [Listed(o, replay) for o in failures_first(outcomes) for replay in _rays(o)]
    rays.sort(key=lambda ray: ray.replay.in_band)
    return Section(
        anchor=anchor,
        scene=scene,
        outcomes=outcomes,
        failed=[outcome for outcome in failures_first(outcomes) if not outcome.passed],
        pictures=_pictures(outcomes),
        rays=rays[:LISTED],
        unlisted=len(rays[LISTED:]),
        thumbnail=_thumbnail(outcomes),
        ridges=_drawn(draw_ridges(outcomes), f"{anchor}-r", f"Errors in ulp, a ridge a term, {scene}"),
        scatter=_drawn(draw_scatter(outcomes), f"{anchor}-s", f"Differences by distance from edges, {scene}"),
        growth=_drawn(draw_growth(outcomes), f"{anchor}-g", f"Growth of errors along chains, {scene}"),
    )


def _rays(outcome: Outcome) -> list[Replay]:
    """The differing rays of an outcome; the worst one of those that failed is always among them."""
    worst = outcome.worst
    if outcome.passed or worst is None or worst in outcome.differing:
        return list(outcome.differing)
    return [worst, *outcome.differing]


def _pictures(outcomes: list[Outcome]) -> list[Pictures]:
    """Of each term with pictures the precision that uses most of its allowance; colors before depths."""
    worst: dict[str, Outcome] = {}
    for outcome in failures_first(outcomes):
        if outcome.panels is not None:
            worst.setdefault(outcome.term, outcome)
    found = [
        Pictures(outcome, trio_of(outcome.panels), _figures(outcome))
        for outcome in worst.values()
        if outcome.panels is not None
    ]
    return sorted(found, key=lambda pictures: pictures.trio.kind)


def _thumbnail(outcomes: list[Outcome]) -> str:
    colors = (o.panels for o in outcomes if o.panels is not None and o.panels.kind == "color")
    first = next(colors, None)
    return "" if first is None else thumbnail(first)


def _figures(outcome: Outcome) -> str:
    return ", ".join(f"{name} {number(value)}" for name, value in outcome.figures.items())


def _drawn(figure: Figure | None, name: str, description: str) -> Markup | None:
    return None if figure is None else Markup(svg.svg_of(figure, name, escape(description)))
