"""The rays of a pixel between the outlines of the shapes, seen from the left and from above."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon
from numpy.typing import NDArray

from reference import plain
from tracer_docs.ray_tree import Story, TracedRay
from tracer_docs.themes import Theme, shown


@dataclass(frozen=True)
class View:
    """A projection along an axis: which coordinates go right and up."""

    title: str
    right: int
    up: int

    @property
    def across(self) -> int:
        """The axis along which one looks."""
        return 3 - self.right - self.up

    def of(self, point: plain.Vec) -> tuple[float, float]:
        """The place of a point on the page."""
        return point[self.right], point[self.up]


VIEWS = (View("seen from the left", right=2, up=1), View("seen from above", right=2, up=0))
LABEL_DISTANCE = 92.0  # least distance of two numbers, in units of the scene


def draw_rays(story: Story, theme: Theme) -> Figure:
    """The rays between the outlines of the shapes, in both views, one below the other."""
    figure = Figure(figsize=(7.6, 8.7), layout="constrained")
    low, high = room_bounds(story)
    heights = [float(high[view.up] - low[view.up]) for view in VIEWS]
    for axes, view in zip(figure.subplots(2, 1, height_ratios=heights, sharex=True), VIEWS, strict=True):
        _draw_room(axes, story, theme, view, low, high)
        for ray in story.rays:
            ends = [view.of(ray.node.origin), view.of(end_of(ray))]
            width = 0.9 + 2.2 * ray.node.weight**0.5
            color = theme.rays[ray.node.kind]
            axes.plot(*zip(*ends, strict=True), color=color, lw=width, solid_capstyle="round", zorder=3)
        _draw_numbers(axes, story, theme, view)
        axes.set_title(view.title, color=theme.ink, fontsize=9, loc="left")
        axes.set_aspect("equal")
        axes.set_axis_off()
    handles = [
        Line2D([], [], color=theme.rays[kind], lw=2, label=kind.replace("_", " "))
        for kind in dict.fromkeys(ray.node.kind for ray in story.rays)
    ]
    figure.legend(
        handles=handles,
        loc="outside upper right",
        ncols=len(handles),
        fontsize=9,
        frameon=False,
        labelcolor=theme.ink,
    )
    return figure


def room_bounds(story: Story) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The box of everything drawn: rays, eye, finite shapes, and the planes that are parallel to an axis."""
    points = [end_of(ray) for ray in story.rays] + [ray.node.origin for ray in story.rays]
    points.append(story.world.camera.eye)
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    for shape in story.world.shapes:
        geometry = shape.geometry
        if isinstance(geometry, plain.Plane):
            axis = int(np.argmax(np.abs(geometry.normal)))
            if abs(geometry.normal[axis]) > 1 - 1e-9:
                place = -geometry.d / geometry.normal[axis]
                low[axis], high[axis] = min(low[axis], place), max(high[axis], place)
        else:
            corners = extent_of(geometry)
            low, high = np.minimum(low, corners[0]), np.maximum(high, corners[1])
    return low, high


def extent_of(geometry: plain.Sphere | plain.Mesh) -> tuple[plain.Vec, plain.Vec]:
    """The lowest and highest corner of the box around a finite shape."""
    if isinstance(geometry, plain.Mesh):
        return geometry.low, geometry.high
    r = plain.vec([geometry.radius] * 3)
    return geometry.center - r, geometry.center + r


def end_of(ray: TracedRay) -> plain.Vec:
    """Where a ray hits; a miss is drawn as long as the longest side of a room."""
    t = ray.node.t if ray.shape else 1000.0
    return ray.node.origin + t * ray.node.direction


def _draw_room(
    axes: Axes, story: Story, theme: Theme, view: View, low: NDArray[np.float64], high: NDArray[np.float64]
) -> None:
    met = {ray.node.shape for ray in story.rays}
    for number, shape in enumerate(story.world.shapes):
        color, geometry = tint_of(story, number), shape.geometry
        line = {"ec": theme.ink if number in met else theme.faint, "lw": 1.1 if number in met else 0.7}
        fill = {"fc": (*color, 0.30 if number in met else 0.10), **line}
        if isinstance(geometry, plain.Sphere):
            axes.add_patch(Circle(view.of(geometry.center), geometry.radius, **fill))
        elif isinstance(geometry, plain.Mesh):
            outline = hull([view.of(vertex) for vertex in geometry.vertices])
            axes.add_patch(Polygon(outline, closed=True, **fill))
        elif abs(geometry.normal[view.across]) < 1e-9:
            _draw_plane(axes, view, geometry, low, high, line)
    eye, center = story.world.camera.eye, story.rays[0].node.origin
    axes.plot(*zip(view.of(eye), view.of(center), strict=True), ls=(0, (2, 2)), lw=0.9, color=theme.faint)
    axes.plot(*view.of(eye), marker="o", ms=5, color=theme.ink)
    axes.annotate(
        "eye",
        view.of(eye),
        xytext=(0, 6),
        textcoords="offset points",
        ha="center",
        fontsize=8,
        color=theme.ink,
    )
    camera = story.world.camera
    half = 0.5 * camera.pixel_size * (camera.height if view.up == 1 else camera.width)
    along = camera.down if view.up == 1 else camera.right
    ends = [camera.center - half * along, camera.center + half * along]
    axes.plot(*zip(*(view.of(end) for end in ends), strict=True), lw=1.6, color=theme.faint)
    top = max((view.of(end) for end in ends), key=lambda place: place[1])
    axes.annotate(
        "canvas", top, xytext=(5, -3), textcoords="offset points", fontsize=8, color=theme.faint, va="top"
    )


def _draw_plane(
    axes: Axes,
    view: View,
    plane: plain.Plane,
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    line: dict[str, object],
) -> None:
    """The trace of a plane that is seen edge on, within the bounds."""
    a, b = plane.normal[view.right], plane.normal[view.up]
    points = []
    for axis, other, m, n in ((view.right, view.up, a, b), (view.up, view.right, b, a)):
        for bound in (low[axis], high[axis]):
            if abs(n) > 1e-9:
                place = -(plane.d + m * bound) / n
                if low[other] - 1e-6 <= place <= high[other] + 1e-6:
                    points.append((bound, place) if axis == view.right else (place, bound))
    if len(points) >= 2:
        axes.plot(*zip(min(points), max(points), strict=True), color=line["ec"], lw=line["lw"])


def _draw_numbers(axes: Axes, story: Story, theme: Theme, view: View) -> None:
    """The number of each ray at its end, moved aside where numbers would cover each other."""
    ends = np.array([view.of(end_of(ray)) for ray in story.rays])
    for ray, end, place in zip(story.rays, ends, spread(ends), strict=True):
        color = theme.rays[ray.node.kind]
        axes.plot(*end, marker="o", ms=3.5, color=color, zorder=4)
        if np.linalg.norm(place - end) > LABEL_DISTANCE / 4:
            axes.plot(*zip(end, place, strict=True), lw=0.8, color=color, zorder=4)
        circle: dict[str, Any] = {"boxstyle": "circle,pad=0.22", "fc": theme.paper, "ec": color, "lw": 1.2}
        look: dict[str, Any] = {"fontsize": 7.5, "ha": "center", "va": "center", "color": theme.ink}
        axes.text(place[0], place[1], str(ray.number), **look, zorder=5, bbox=circle)


def spread(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places near the points (n, 2), at least about `LABEL_DISTANCE` apart."""
    places = points + 1e-3 * np.arange(points.size).reshape(points.shape)  # no two are equal
    for _ in range(200):
        for k in range(len(places)):
            away = places[k] - np.delete(places, k, axis=0)
            distance = np.linalg.norm(away, axis=1, keepdims=True)
            push = np.maximum(0, LABEL_DISTANCE - distance) * away / distance
            places[k] += 0.3 * push.sum(axis=0)
    return places


def tint_of(story: Story, number: int) -> tuple[float, float, float]:
    """A color for a shape: its own where it has one, else that of the first hit on it, else gray."""
    color = getattr(story.scene.shapes[number], "color", None)
    if color is not None:
        return color
    seen = [ray.node.surface_color for ray in story.rays if ray.node.shape == number]
    return shown(seen[0]) if seen else (0.6, 0.6, 0.6)


def hull(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The convex hull, counterclockwise (Andrew's monotone chain)."""

    def chain(ordered: list[tuple[float, float]]) -> list[tuple[float, float]]:
        kept: list[tuple[float, float]] = []
        for p in ordered:
            while len(kept) > 1 and _turn(kept[-2], kept[-1], p) <= 0:
                kept.pop()
            kept.append(p)
        return kept[:-1]

    ordered = sorted(set(points))
    return chain(ordered) + chain(ordered[::-1])


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
