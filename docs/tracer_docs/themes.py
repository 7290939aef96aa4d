"""The two looks of the site's drawings, and colors and numbers as they are shown."""

from __future__ import annotations

from dataclasses import dataclass

from reference import plain


@dataclass(frozen=True)
class Theme:
    """Colors of one of the two looks of the site."""

    name: str
    ink: str
    faint: str
    paper: str
    rays: dict[str, str]


KINDS = ("primary", "reflected", "refracted", "total_reflection")
THEMES = (
    Theme("light", "#1f2328", "#6f7780", "#ffffff",
          dict(zip(KINDS, ("#3d4650", "#c8500a", "#0b6fb8", "#8a3fb0"), strict=True))),
    Theme("dark", "#e8eaed", "#98a0a8", "#1e2226",
          dict(zip(KINDS, ("#d5dae0", "#ff9a4d", "#5cb8ff", "#cf8ff0"), strict=True))),
)  # fmt: skip


def numbers(color: plain.Vec) -> str:
    """Three numbers with three digits after the point."""
    return " ".join(f"{channel:.3f}" for channel in color)


def shown(color: plain.Vec) -> tuple[float, float, float]:
    """What a screen can show."""
    r, g, b = (min(1.0, max(0.0, channel)) for channel in color)
    return r, g, b
