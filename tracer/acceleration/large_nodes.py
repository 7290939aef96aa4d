"""Large nodes of the hierarchy, cut level by level with a lane for every chunk of their triangles."""

from __future__ import annotations

from typing import Any

import numpy as np

from tracer.acceleration.bins import (
    BINS,
    BOX_WORDS,
    COUNT,
    SMALLEST_EXTENT,
    Cut,
    chunk_bins,
    chunk_extents,
    parted,
)
from tracer.acceleration.subtrees import LARGEST_SUBTREE
from tracer.backends import Backend

CHUNK = LARGEST_SUBTREE
"""Triangles of a lane at most. Not more than those of a small node: so every large one has two chunks."""


def cut_large_nodes(backend: Backend, table: Any, n: int) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray]:
    """Cuts the node of n boxes until no node holds more than `LARGEST_SUBTREE`.

    Returns the boxes in a new order; the nodes level by level: the left child of each, which the right one
    follows, or for a small one -1 - twice its first slot; first slots and counts of the small ones.
    """
    first, count, nodes = np.zeros(1, np.int64), np.full(1, n), 1
    small_first, small_count, top = [], [], []
    while True:
        large = count > LARGEST_SUBTREE
        top.append(np.where(large, nodes + 2 * (large.cumsum() - 1), -1 - 2 * first))
        small_first.append(first[~large])
        small_count.append(count[~large])
        others = np.concatenate(small_first), np.concatenate(small_count)
        if not large.any():
            return table, np.concatenate(top), *others
        first, count = first[large], count[large]
        table, in_left = _Chunks(backend, first, count).cut(table, *others)
        first = np.stack([first, first + in_left], axis=1).ravel()
        count = np.stack([in_left, count - in_left], axis=1).ravel()
        nodes += len(first)


class _Chunks:
    """The chunks of some nodes, laid end to end: `node` number, `rank` within it, `begin` and `end` of the
    slots; `offsets`: where those of a node begin."""

    def __init__(self, backend: Backend, first: np.ndarray, count: np.ndarray) -> None:
        self.backend, self.first = backend, first
        self.chunks = -(-count // CHUNK)
        self.offsets = self.chunks.cumsum() - self.chunks
        self.node = np.repeat(np.arange(len(first)), self.chunks)
        self.rank = np.arange(len(self.node)) - self.offsets[self.node]
        self.begin = first[self.node] + self.rank * CHUNK
        self.end = np.minimum(self.begin + CHUNK, (first + count)[self.node])

    def cut(self, table: Any, other_first: np.ndarray, other_count: np.ndarray) -> tuple[Any, np.ndarray]:
        """The boxes parted, and how many of each node went left. The others stay where they are."""
        low, scale = self._scales(table)
        bins = self._bins(table, low, scale)
        axis, place = self._best(bins)
        nodes, chunks = np.arange(len(axis)), np.arange(len(self.node))
        # Where all centroids coincide no bin tells triangles apart: half of the chunks.
        place = np.where(
            place[self.node] > 0, place[self.node], BINS * (self.rank < self.chunks[self.node] // 2)
        )
        counts = np.concatenate([0 * bins[0, :, :1, COUNT], bins[axis[self.node], chunks, :, COUNT]], axis=1)
        left = counts.cumsum(axis=1)[chunks, place].astype(np.int64)
        in_left = np.add.reduceat(left, self.offsets)
        before = left.cumsum() - left
        before -= before[self.offsets][self.node]
        left_to = self.first[self.node] + before
        right_to = in_left[self.node] + self.begin - before
        ids, numbers = self.backend.id_table, self.backend.single_table

        def lanes(values: np.ndarray, others: np.ndarray = 0 * other_first) -> np.ndarray:
            return np.concatenate([values, others])

        cut = Cut(
            axis=ids(lanes(axis[self.node])),
            low=numbers(lanes(low[axis, nodes][self.node])),
            scale=numbers(lanes(scale[axis, nodes][self.node])),
            place=ids(lanes(place)),
        )
        begin, end = ids(lanes(self.begin, other_first)), ids(lanes(self.end, other_first + other_count))
        moved = parted(
            self.backend,
            table,
            begin,
            end,
            cut,
            ids(lanes(left_to, other_first)),
            ids(lanes(right_to, other_first)),
        )
        return moved, in_left

    def _axes(self) -> tuple[Any, Any, Any]:
        """Lanes for every chunk on every axis: begin, end, axis."""
        ids = self.backend.id_table
        return (
            ids(np.tile(self.begin, 3)),
            ids(np.tile(self.end, 3)),
            ids(np.repeat(range(3), len(self.node))),
        )

    def _scales(self, table: Any) -> tuple[np.ndarray, np.ndarray]:
        """(3, nodes): where the first bin begins, and bins per length."""
        low, high = (x.numpy().reshape(3, -1) for x in chunk_extents(self.backend, table, *self._axes()))
        low = np.minimum.reduceat(low, self.offsets, axis=1)
        apart = np.maximum.reduceat(high, self.offsets, axis=1) - low
        far = apart > SMALLEST_EXTENT
        return low, np.divide(np.float32(BINS), apart, out=np.zeros_like(apart), where=far)

    def _bins(self, table: Any, low: np.ndarray, scale: np.ndarray) -> np.ndarray:
        """(3, chunks, BINS, BOX_WORDS)."""
        begin, end, axis = self._axes()
        low_of, scale_of = (self.backend.single_table(x[:, self.node]) for x in (low, scale))
        cut = Cut(axis, low_of, scale_of, axis)
        return chunk_bins(self.backend, table, begin, end, cut).numpy().reshape(3, -1, BINS, BOX_WORDS)

    def _best(self, bins: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Axis of the cheapest cut of each node, and its bins on the left; 0 where nothing tells the
        triangles apart."""
        lower = np.minimum.reduceat(bins[..., :3], self.offsets, axis=1)
        upper = np.maximum.reduceat(bins[..., 3:6], self.offsets, axis=1)
        count = np.add.reduceat(bins[..., COUNT], self.offsets, axis=1)
        left = _weights(lower, upper, count)
        right = _weights(lower[:, :, ::-1], upper[:, :, ::-1], count[:, :, ::-1])
        costs = (left[..., :-1] + right[..., -2::-1]).swapaxes(0, 1).reshape(-1, 3 * (BINS - 1))
        axis, place = np.divmod(costs.argmin(axis=1), BINS - 1)
        return axis, np.where(np.isfinite(costs.min(axis=1)), place + 1, 0)


def _weights(lower: np.ndarray, upper: np.ndarray, count: np.ndarray) -> np.ndarray:
    """(3, nodes, BINS): area times triangles of the first bins, of one, of two, ...; infinite where they are
    empty."""
    number = count.cumsum(axis=2)
    size = np.maximum.accumulate(upper, axis=2) - np.minimum.accumulate(lower, axis=2)
    x, y, z = (np.where(number > 0, size[..., k], 0) for k in range(3))
    return np.where(number > 0, (x * y + y * z + z * x) * number, np.inf)
