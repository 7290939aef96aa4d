"""Triangles about which a bundle could not decide, noted with the rays that they concern.

A bundle walks past many triangles and is certain about nearly all of them. A ray that is left in doubt needs
the exact test of a few, not another walk.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.backends import Backend
from tracer.branches import changed_where

MOST = 8
"""Of a bundle. Those that would have to note more leave their doubtful rays to single walks."""


@dataclass
class Candidates:
    """Of n bundles: the `slots` of triangles (MOST n,), and for each a word with a bit for each `concerned`
    ray (MOST n,). How many there are, those who write and read have to count."""

    slots: Any
    concerned: Any

    @staticmethod
    def room(backend: Backend, bundles: int) -> Candidates:
        """For so many bundles, with nothing noted yet."""
        return Candidates(*(dr.empty(backend.UInt32, bundles * MOST) for _ in range(2)))

    def note(self, bundle: Any, count: Any, slot: Any, concerned: Any) -> Any:
        """Notes one more triangle of bundles (n,) that have noted `count` (n,), where it concerns any ray;
        returns how many there are then. From MOST on they are only counted."""

        def written(count: Any) -> Any:
            place = bundle * MOST + dr.minimum(count, MOST - 1)
            dr.scatter(self.slots, slot, place)
            dr.scatter(self.concerned, concerned, place)
            return count + 1

        return changed_where(concerned != 0, count, written, label="candidate")

    def fold(self, bundle: Any, count: Any, ray: Any, test: Callable[[Any, Any], Any], state: Any) -> Any:
        """Folds the triangles that concern rays with these numbers (n,) in their bundles (n,) into a state:
        `test(slot, state)` is the next one. `count` (n,): as noted, MOST at most."""
        index = type(bundle)
        bit = index(1) << ray

        def body(k: Any, state: Any) -> tuple[Any, Any]:
            place = bundle * MOST + k
            concerns = (dr.gather(index, self.concerned, place) & bit) != 0
            next_state = changed_where(
                concerns, state, lambda state: test(dr.gather(index, self.slots, place), state), "concerned"
            )
            return k + 1, next_state

        _, state = dr.while_loop(
            state=(dr.zeros(index, dr.width(bundle)), state),
            cond=lambda k, state: k < count,
            body=body,
            label="candidates",
        )
        return state
