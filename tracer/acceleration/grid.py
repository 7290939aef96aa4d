"""A grid of 65,536 steps an axis over the root of a hierarchy: planes of boxes as 16-bit numbers.

Half the bytes a node, so more of the tree stays in the caches. Rounded outwards, a box holds what it held; it
only may be met a little more often.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tracer.acceleration.build import Hierarchy
from tracer.backends import Backend

STEPS = 65535
"""Largest number of a plane."""

CROWD, ROOM = 16, 16
"""Where a box of less than `ROOM` steps holds more triangles than `CROWD`, the grid cannot tell them apart: a
small detailed mesh next to a huge one needs floats."""


@dataclass
class Grid:
    """Number q of a plane means `low` + q `step` (3, 1)."""

    low: Any
    step: Any


@dataclass(frozen=True)
class HostGrid:
    """The same on the host, in numbers (3,) that single precision has; `lower`, `upper` (n, 3): all boxes on
    it."""

    low: np.ndarray
    step: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    def rows(self, tree: Hierarchy, links: np.ndarray) -> np.ndarray:
        """(n, 4) words of nodes for directions without a negative component."""
        rows = np.empty((len(links), 4), np.uint32)
        rows[:, :3] = self.lower | self.upper << 16
        rows[:, 3] = links
        return rows

    def on_device(self, backend: Backend) -> Grid:
        """For kernels."""
        return Grid(backend.opaque_vector(self.low), backend.opaque_vector(self.step))


def find_grid(tree: Hierarchy) -> HostGrid | None:
    """The grid of a tree, None where it is too coarse for some part of it."""
    low = tree.lower[0].astype(np.float64)
    high = tree.upper[0].astype(np.float64)
    # Nowhere 0, so that a flat root has steps, too.
    smallest = np.finfo(np.float32).tiny + np.maximum(-low, high).max() * 2.0**-24
    step = np.maximum((high - low) / (STEPS - 1), smallest).astype(np.float32).astype(np.float64)
    lower = np.floor((tree.lower - low) / step)
    upper = np.ceil((tree.upper - low) / step)
    # Division rounds: a plane may have come out a step too far in.
    lower -= low + lower * step > tree.lower
    upper += low + upper * step < tree.upper
    if ((tree.count > CROWD) & ((upper - lower).max(axis=1) < ROOM)).any():
        return None
    return HostGrid(low, step, lower.astype(np.uint32), upper.astype(np.uint32))
