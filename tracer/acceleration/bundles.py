"""Bundles: rays through one point, sixteen neighbors to a lane, where rounding cannot change the answer.

A lane takes sixteen neighboring rays through the hierarchy at once. A box is met when it may be met by any
direction between theirs, so they share the work of reaching it; and because all run through one point, the
planes through that point and the edges of a triangle are computed once for all of them (`bundle_tests.py`).
The point is the eye (`first_of_bundles.py`) or a light (`shadows_of_bundles.py`).

The answers are those of one ray at a time (`traverse.py`), for a bundle only gives those that are certain:
edge functions, distances and their order must be clear of a bound on all rounding, that of the other test
included. A few rays in a hundred pass close to an edge; of these the bundle notes which triangles it cannot
decide about (`candidates.py`), and each is tested against those alone. What still is `DOUBTFUL` is asked
singly: where that does not tell enough, and all rays of bundles that meet too many triangles, since where
these are much smaller than pixels, neighbors have little in common.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.acceleration.candidates import MOST, Candidates
from tracer.backends import INVALID, Backend

RAYS = 16
"""Rays of a bundle: 4 x 4 pixels. 8 share less, for meshes of a triangle a pixel or less."""

DOUBTFUL = INVALID - 1
"""In place of an answer: rounding could change it."""


def neighbors(backend: Backend, values: Any, bundle: Any) -> list[Any]:
    """The values (RAYS n,) of the RAYS rays of bundles by number, (n,) each."""
    # Packets have 8 words at most.
    packet = backend.IdN if type(values) is backend.UInt32 else backend.FloatN
    shape, halves = (8, dr.width(bundle)), range(RAYS // 8)
    parts = [dr.gather(packet, values, bundle * len(halves) + half, shape=shape) for half in halves]
    return [part[k] for part in parts for k in range(8)]


def neighboring_points(backend: Backend, points: Any, bundle: Any) -> list[Any]:
    """The same of vectors (3, RAYS n)."""
    components = (neighbors(backend, component, bundle) for component in points)
    return [backend.Vector3(*point) for point in zip(*components, strict=True)]


@dataclass
class Found:
    """What n bundles found: the `answers` to their rays (RAYS n,). Those with a bit in `open` (n,) need more:
    they are `DOUBTFUL`, or depend on the first `noted` (n,) of the bundle's candidates, `slots` and
    `concerned` (see `Candidates`). `unknown` (n,): 1 for bundles that belong to the kernel for both signs
    (see `Cones`), else 0; they have no answers."""

    answers: Any
    open: Any
    noted: Any
    slots: Any
    concerned: Any
    unknown: Any

    @staticmethod
    def of(
        backend: Backend,
        answers: list[Any],
        lost: Any,
        close: Any,
        noted: Any,
        candidates: Candidates,
        unknown: Any,
    ) -> Found:
        """From answers by ray of a bundle (n,), none for those with a bit in `lost` (n,); `unknown`: mask."""
        too_many = noted > MOST
        lost, noted = lost | dr.select(too_many, close, 0), dr.select(too_many, 0, noted)
        places = dr.arange(backend.UInt32, dr.width(answers[0])) * RAYS
        all_answers = dr.empty(backend.UInt32, dr.width(answers[0]) * RAYS)
        for k, answer in enumerate(answers):
            known = dr.select((lost >> k) & 1 != 0, DOUBTFUL, answer)
            # In any other mode each starts a kernel of its own, with all of the walk.
            dr.scatter(all_answers, known, places + k, mode=dr.ReduceMode.Permute)
        return Found(
            answers=all_answers,
            open=dr.select(unknown, 0, close | lost),
            noted=noted,
            slots=candidates.slots,
            concerned=candidates.concerned,
            unknown=dr.select(unknown, backend.UInt32(1), 0),
        )

    def open_places(self, someone: bool) -> Any:
        """The places (k,) of rays that need more than their bundle, as by `_numbers_where`."""
        bundles = _numbers_where(self.open != 0, someone)
        if len(bundles) == 0:
            return bundles
        chosen = _numbers_where(self.is_open(_all_rays_of(bundles)), someone)
        return _rays_of(bundles, chosen)

    def is_open(self, places: Any) -> Any:
        """Mask (k,): the rays in these places need more."""
        return (dr.gather(type(places), self.open, places // RAYS) >> (places % RAYS)) & 1 != 0

    def fold(self, places: Any, test: Callable[[Any, Any], Any], state: Any) -> Any:
        """Folds the candidates of rays in these places (k,), which have answers, into a state:
        `test(slot, state)` is the next one."""
        bundle = places // RAYS
        noted = dr.gather(type(places), self.noted, bundle)
        return Candidates(self.slots, self.concerned).fold(bundle, noted, places % RAYS, test, state)


def answers_to(
    index: Any,
    rays: int,
    in_bundles: Callable[[Any, bool], Found],
    among: Callable[[Found, Any, Any], Any],
    singly: Callable[[Any], Any],
    every_kernel: bool = False,
) -> Any:
    """The answers to so many rays by number.

    `in_bundles(numbers, both)`: by bundles with these numbers (n,), by the kernel for both signs or the
    other; `among(found, places, numbers)`: by the candidates of rays in these places (k,) of what bundles
    found, or `DOUBTFUL`; `singly(numbers)`: by walks of single rays (k,). `index`: the type of numbers and
    answers. `every_kernel`: where no ray needs one of these, the first is asked all the same, which changes
    no answer: so all kernels are compiled, and none when other rays need them.
    """

    def settled(bundles: Any, both: bool) -> Found:
        found = in_bundles(bundles, both)
        places = found.open_places(every_kernel)
        if len(places) > 0:
            numbers = _rays_of(bundles, places)
            answers = among(found, places, numbers)
            doubtful = _numbers_where(answers == DOUBTFUL, every_kernel)
            if len(doubtful) > 0:
                dr.scatter(answers, singly(dr.gather(index, numbers, doubtful)), doubtful)
            dr.scatter(found.answers, answers, places)
        dr.eval(found.answers)
        return found

    found = settled(dr.arange(index, rays // RAYS), False)
    numbers = _numbers_where(found.unknown == 1, every_kernel)
    if len(numbers) > 0:
        answers = settled(numbers, True).answers
        # Only now: what waits while a program runs becomes another kernel if that was just recorded.
        dr.scatter(found.answers, answers, _all_rays_of(numbers))
        dr.eval(found.answers)
    return found.answers


def _rays_of(bundles: Any, places: Any) -> Any:
    """The numbers (k,) of rays in these places among all of the bundles with these numbers (n,)."""
    return dr.gather(type(bundles), bundles, places // RAYS) * RAYS + places % RAYS


def _all_rays_of(bundles: Any) -> Any:
    """The numbers (RAYS n,) of all rays of the bundles with these numbers (n,)."""
    return _rays_of(bundles, dr.arange(type(bundles), len(bundles) * RAYS))


def _numbers_where(mask: Any, someone: bool) -> Any:
    """Numbers of the lanes of a mask, evaluated, the last one repeated up to a length that few others differ
    from, since each length is recorded for itself. When there are none they are empty, or the first lane
    where it has to be `someone`."""
    numbers: Any = dr.compress(mask)
    n, index = len(numbers), type(numbers)
    if n == 0 and not someone:
        return numbers
    if n <= 1:
        # Arrays of one number would have kernels of their own.
        n, numbers = RAYS, dr.opaque(index, numbers[0] if n else 0, RAYS)
    step = max(RAYS, 1 << max(0, n.bit_length() - 3))
    slot = dr.arange(index, -(-n // step) * step)
    padded = dr.gather(index, numbers, dr.minimum(slot, dr.opaque(index, n - 1)))
    dr.eval(padded)
    return padded
