"""The pictures of a view, one after the other: a draft at once, then the full picture, then all sub-rays."""

from __future__ import annotations

from dataclasses import dataclass

from tracer.viewer.state import View


@dataclass(frozen=True)
class Stage:
    """A picture of a view: its scale, and n for n x n rays a pixel; `is_draft`: made at once, and structure
    kept as it was; `is_final`: nothing better follows."""

    scale: float
    supersample: int
    is_draft: bool = False
    is_final: bool = False


def stages_of(view: View, scale: float) -> list[Stage]:
    """The stages of a view whose draft may have that scale."""
    n = view.scene.camera.supersample
    between = [Stage(1.0, 1)] if scale < 1 and n > 1 else []
    return [Stage(scale, 1, is_draft=True), *between, Stage(1.0, n, is_final=True)]
