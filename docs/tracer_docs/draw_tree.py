"""The tree of a pixel's rays: a box for each ray, a branch for each share."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch, Rectangle

from tracer_docs.ray_tree import Story, TracedRay
from tracer_docs.themes import Theme, numbers, shown

BOX_WIDTH, BOX_HEIGHT, STEP_X, STEP_Y = 1.5, 0.98, 1.72, 1.62
LINE = 0.19  # height of a line for a ray that is not traced


def draw_tree(story: Story, theme: Theme) -> Figure:
    """A box for each ray: kind, weight, what it hits, the color it brings, what its hit adds to the pixel."""
    places = {ray.number: place for ray, place in _places(story, story.rays[0])}
    columns = 1 + max(x for x, _ in places.values())
    levels = 1 + max(ray.node.level for ray in story.rays)
    width, height = columns * STEP_X, levels * STEP_Y - 0.15
    figure = Figure(figsize=(width, height))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(
        xlim=(-STEP_X / 2, width - STEP_X / 2), ylim=(-height + BOX_HEIGHT / 2 + 0.06, BOX_HEIGHT / 2 + 0.06)
    )
    axes.set_axis_off()
    centers = {number: (x * STEP_X, -level * STEP_Y) for number, (x, level) in places.items()}
    for ray in story.rays:
        if ray.parent is not None:
            _draw_branch(axes, theme, centers[ray.parent], centers[ray.number], ray)
    for ray in story.rays:
        _draw_box(axes, theme, centers[ray.number], ray)
    return figure


def _places(story: Story, ray: TracedRay, left: float = 0.0) -> Iterator[tuple[TracedRay, tuple[float, int]]]:
    """Columns: a leaf takes one, a parent stands above the middle of its children."""
    inner: list[tuple[TracedRay, tuple[float, int]]] = []
    children = story.children(ray)
    for child in children:
        below = list(_places(story, child, left))
        left = 1 + max(x for _, (x, _) in below)
        inner += below
    places = {other.number: x for other, (x, _) in inner}
    middle = sum(places[child.number] for child in children) / len(children) if children else left
    yield ray, (middle, ray.node.level)
    yield from inner


def _draw_branch(
    axes: Axes, theme: Theme, start: tuple[float, float], end: tuple[float, float], ray: TracedRay
) -> None:
    color = theme.rays[ray.node.kind]
    (x0, y0), (x1, y1) = (start[0], start[1] - BOX_HEIGHT / 2), (end[0], end[1] + BOX_HEIGHT / 2)
    width = 0.9 + 2.6 * ray.node.weight**0.5
    axes.plot([x0, x1], [y0, y1], color=color, lw=width, solid_capstyle="round", zorder=1)
    place = (0.4 * x0 + 0.6 * x1, 0.4 * y0 + 0.6 * y1)
    look: dict[str, Any] = {"fontsize": 7.5, "ha": "center", "va": "center", "color": color}
    paper: dict[str, Any] = {"boxstyle": "round,pad=0.2", "fc": theme.paper, "ec": "none"}
    axes.text(*place, f"× {ray.node.factor:g}", **look, bbox=paper, zorder=2)


def _draw_box(axes: Axes, theme: Theme, center: tuple[float, float], ray: TracedRay) -> None:
    (x, y), color = center, theme.rays[ray.node.kind]
    height = BOX_HEIGHT + LINE * len(ray.ended)
    left, bottom = x - BOX_WIDTH / 2, y + BOX_HEIGHT / 2 - height
    shape = "round,pad=0.04,rounding_size=0.08"
    size = {"width": BOX_WIDTH - 0.08, "height": height - 0.08}
    axes.add_patch(
        FancyBboxPatch(
            (left + 0.04, bottom + 0.04), **size, lw=1.3, fc=theme.paper, ec=color, boxstyle=shape, zorder=3
        )
    )
    swatch: dict[str, Any] = {"fc": shown(ray.node.color), "ec": theme.faint, "lw": 0.6, "zorder": 4}
    axes.add_patch(Rectangle((left + 0.08, y + 0.02), 0.36, 0.36, **swatch))
    ink: dict[str, Any] = {"color": theme.ink, "fontsize": 7}
    lines: list[tuple[str, tuple[float, float], dict[str, Any]]] = [
        (
            f"{ray.number}  {ray.node.kind.replace('_', ' ')}",
            (left + 0.52, y + 0.31),
            {"color": color, "weight": "bold"},
        ),
        (ray.name, (left + 0.52, y + 0.10), ink),
        (f"weight {ray.node.weight:.3g}", (left + 0.08, y - 0.14), ink),
        ("adds " + numbers(ray.contribution), (left + 0.08, y - 0.33), ink),
    ]
    for k, share in enumerate(ray.ended):
        text = f"{share.kind} {share.weight:.4f}: {share.reason}"
        lines.append(
            (text, (left + 0.08, y - 0.33 - LINE * (k + 1)), {"color": theme.faint, "style": "italic"})
        )
    for text, place, look in lines:
        axes.text(*place, text, va="center", ha="left", zorder=4, **{"fontsize": 7, **look})
