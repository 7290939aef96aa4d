"""What tests of hierarchies share."""

from __future__ import annotations

import pytest

from tracer.acceleration import grid, layout


@pytest.fixture(params=["grid", "floats"])
def form(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Both ways to keep the planes of boxes, whatever suits a mesh."""
    monkeypatch.setattr(grid, "ROOM", 0)
    if request.param == "floats":
        monkeypatch.setattr(layout, "find_grid", lambda tree: None)
    return request.param
