"""The lists of a hierarchy on this side: to look into them, and to damage them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tracer.acceleration.build import Hierarchy
from tracer.acceleration.layout import FLOAT_WORDS, GRID_WORDS, LEAF, OCTANTS, NodeLists, threaded
from tracer.backends import Backend, find_backend

Array = np.ndarray


@dataclass
class Lists:
    """The layout on this side: planes (8 n, 3) in the units of the lists, and links (8 n,)."""

    first: Array
    last: Array
    link: Array

    @staticmethod
    def of(found: NodeLists) -> Lists:
        words = found.words.numpy()
        if found.grid is None:
            rows = words.reshape(-1, FLOAT_WORDS)[:-1]
            floats = rows.view(np.float32)
            return Lists(floats[:, 0:3].copy(), floats[:, 4:7].copy(), rows[:, 3].copy())
        rows = words.reshape(-1, GRID_WORDS)[:-1]
        return Lists(rows[:, :3] & 0xFFFF, rows[:, :3] >> 16, rows[:, 3].copy())

    def on_device(self, found: NodeLists) -> NodeLists:
        """The same lists with these words."""
        if found.grid is None:
            rows = np.zeros((len(self.link) + 1, FLOAT_WORDS), np.uint32)
            floats = rows.view(np.float32)
            floats[:-1, 0:3], floats[:-1, 4:7], rows[:-1, 3] = self.first, self.last, self.link
        else:
            rows = np.zeros((len(self.link) + 1, GRID_WORDS), np.uint32)
            rows[:-1, :3], rows[:-1, 3] = self.first | self.last << 16, self.link
        return replace(found, words=find_backend().id_table(rows))

    def slots(self, places: list[int]) -> list[int]:
        """What lies in the leaves among these."""
        leaves = [int(word) - LEAF for word in self.link[places] if word >= LEAF]
        return [slot for word in leaves for slot in range(word >> 3, (word >> 3) + (word & 7))]


def damaged(damage: Callable[[Lists], None]) -> Callable[[Backend, Hierarchy], NodeLists]:
    """`threaded`, with an error planted in what it gives."""

    def threaded_with_error(backend: Backend, tree: Hierarchy) -> NodeLists:
        found = threaded(backend, tree)
        nodes = Lists.of(found)
        damage(nodes)
        return nodes.on_device(found)

    return threaded_with_error


def jump_too_far(nodes: Lists) -> None:
    """Every other jump skips a node more."""
    count = len(nodes.link) // OCTANTS
    ends = (np.arange(len(nodes.link)) // count + 1) * count
    further = np.minimum(nodes.link + nodes.link % 2, ends)
    nodes.link[:] = np.where(nodes.link < LEAF, further, nodes.link)


def boxes_too_small(nodes: Lists) -> None:
    less = 0.01 * (nodes.last.astype(np.float64) - nodes.first)
    nodes.first[:] = (nodes.first + less).astype(nodes.first.dtype)


def planes_swapped(nodes: Lists) -> None:
    nodes.first[:, 0], nodes.last[:, 0] = nodes.last[:, 0].copy(), nodes.first[:, 0].copy()


def leaf_one_short(nodes: Lists) -> None:
    nodes.link -= ((nodes.link >= LEAF) & (nodes.link & 7 > 1)).astype(np.uint32)
