"""The drawings of a pixel as SVG files, each in a light and a dark version."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from tracer_docs.draw_rays import draw_rays
from tracer_docs.draw_tree import draw_tree
from tracer_docs.ray_tree import Story
from tracer_docs.themes import THEMES, Theme

matplotlib.rcParams["svg.hashsalt"] = "tracer"  # the same file every time


def save_drawings(story: Story, folder: Path) -> dict[str, dict[str, Path]]:
    """Draws everything: {"rays": {"light": path, "dark": path}, "tree": ...}."""
    drawings: dict[str, Callable[[Story, Theme], Figure]] = {"rays": draw_rays, "tree": draw_tree}
    paths: dict[str, dict[str, Path]] = {}
    for name, draw in drawings.items():
        for theme in THEMES:
            path = folder / f"pixel-{name}-{theme.name}.svg"
            nothing = {"Date": None, "Creator": None, "Format": None, "Type": None}
            draw(story, theme).savefig(path, format="svg", transparent=True, metadata=nothing)
            paths.setdefault(name, {})[theme.name] = path
    return paths
