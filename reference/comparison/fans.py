"""Fans: the triangles at an edge that two of them share, or all those around a corner.

Seen from in front of all of them, a fan covers what is near the edge or corner without a gap: whatever
rounding does to a ray that is aimed there, it meets one of them, or something before.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reference.comparison.truth import Truth

Array = np.ndarray


@dataclass(frozen=True)
class Fans:
    """k fans. `ends` (k, 2, 3): of the edge; twice the corner; `is_edge` (k,); `members`: triangles by their
    number in `Truth.corners`, those of a fan end to end, and `first` (k + 1,): where they begin."""

    ends: Array
    is_edge: Array
    members: Array
    first: Array

    def __len__(self) -> int:
        return len(self.ends)

    @staticmethod
    def of(truth: Truth) -> Fans:
        """Edges at which two triangles wound alike meet, and corners at which no edge is another."""
        known = np.flatnonzero(truth.usable)
        shape = np.searchsorted(truth.first, known, side="right") - 1
        points = truth.corners[known]
        rows = np.concatenate([np.repeat(shape, 3)[:, None], points.reshape(-1, 3)], axis=1)
        places, number = np.unique(rows, axis=0, return_inverse=True)
        faces = number.reshape(-1, 3)
        start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
        owner = np.repeat(known, 3)
        partner = _partners(start, end, len(places))
        lone = np.zeros(len(places), bool)
        lone[start[partner < 0]] = lone[end[partner < 0]] = True
        edge = np.flatnonzero((partner >= 0) & (start < end))
        order = np.argsort(start, kind="stable")
        order = order[~lone[start[order]]]
        corner, size = np.unique(start[order], return_counts=True)
        ends = np.stack([np.append(start[edge], corner), np.append(end[edge], corner)], axis=1)
        sizes = np.append(np.full(len(edge), 2), size)
        return Fans(
            ends=places[ends, 1:],
            is_edge=np.arange(len(sizes)) < len(edge),
            members=np.append(np.stack([owner[edge], owner[partner[edge]]], axis=1), owner[order]),
            first=np.append(0, np.cumsum(sizes)),
        )

    def spread(self, chosen: Array) -> Spread:
        """The members of some fans, by number."""
        size = self.first[chosen + 1] - self.first[chosen]
        first = np.cumsum(size) - size
        place = np.arange(size.sum()) + np.repeat(self.first[chosen] - first, size)
        return Spread(self.members[place], np.repeat(np.arange(len(chosen)), size), first)


@dataclass(frozen=True)
class Spread:
    """The members (m,) of n fans, `of` (m,) which fan each is, and where those of each begin."""

    members: Array
    of: Array
    first: Array

    def least(self, values: Array) -> Array:
        """(n,) the smallest of the values (m,) in each fan."""
        return np.minimum.reduceat(values, self.first) if len(self.first) else np.zeros(0)

    def any(self, mask: Array) -> Array:
        """(n,) whether it is so for some member."""
        return np.logical_or.reduceat(mask, self.first) if len(self.first) else np.zeros(0, bool)

    def total(self, values: Array) -> Array:
        """(n, 3) sums in each fan."""
        return np.add.reduceat(values, self.first) if len(self.first) else np.zeros((0, 3))


def _partners(start: Array, end: Array, count: int) -> Array:
    """(h,) the number of the half-edge that runs the other way; -1 where it is not the only one, or this one
    is not."""
    key, reverse = start * count + end, end * count + start
    order = np.argsort(key)
    first, last = (np.searchsorted(key[order], reverse, side) for side in ("left", "right"))
    times = np.searchsorted(key[order], key, "right") - np.searchsorted(key[order], key, "left")
    found = np.where(last - first == 1, order[np.minimum(first, len(key) - 1)], -1)
    return np.where(times == 1, found, -1)
