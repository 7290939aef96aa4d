"""The term of edges and corners: rays aimed at them where the surface has no gap, which no ray may pass.

The truth needs no tolerance: that the ray as both sides get it meets the fan is decided in exact arithmetic.
Who hits nothing, or something clearly behind, let it through; who hits a triangle that the ray misses by more
than rounding made it too large.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from reference.comparison.aims import Aimed, aimed, arrival
from reference.comparison.case import Case, once_a_scene, sizes
from reference.comparison.decisions import LISTED, Answers
from reference.comparison.judge import SINGLE, replay, share_of
from reference.comparison.kinds import has_kind
from reference.comparison.records import Guilty, Outcome, Term
from reference.comparison.truth import MESH
from reference.exact import edge_functions
from reference.tolerances import TOLERANCES

Array = np.ndarray


@dataclass(frozen=True)
class Faults:
    """Masks (n,) of what one side does to rays: `lost`: hits nothing; `behind`: something farther than what
    the ray is aimed at; `beside`: a triangle that the ray misses; `before`: something nearer."""

    lost: Array
    behind: Array
    beside: Array
    before: Array

    @staticmethod
    def of(case: Case, aim: Aimed, given: Answers, epsilon: float) -> Faults:
        """From answers, `epsilon` the unit roundoff of who gave them."""
        truth, spread = case.bench.truth, aim.fans
        hit = given.shape >= 0
        on_mesh = hit & (truth.kind[given.shape] == MESH)
        triangle = np.where(on_mesh, truth.first[given.shape] + given.primitive, -1)
        aimed_at = spread.any(spread.members == triangle[spread.of])
        extent = sizes(truth, aim.rays.o)
        slack = TOLERANCES["distance"].value * epsilon * extent / aim.cosine
        beside = np.zeros(len(hit), bool)
        k = np.flatnonzero(on_mesh)
        gap = _gap(truth.corners[triangle[k]], aim.rays.o[k], aim.rays.d[k])
        beside[k] = gap > TOLERANCES["grazing band"].value * epsilon * extent[k]
        return Faults(
            lost=~hit & np.isfinite(aim.t),
            behind=hit & ~aimed_at & (given.t > aim.t + slack),
            beside=beside,
            before=hit & ~aimed_at & ~beside & (given.t < aim.t - slack),
        )

    @property
    def wrong(self) -> Array:
        """Any of the three that nobody may do."""
        return self.lost | self.behind | self.beside

    def figures(self, side: str) -> dict[str, float]:
        """Counts by name."""
        masks = {"lost": self.lost, "behind": self.behind, "beside": self.beside}
        return {f"{name}, {side}": float(mask.sum()) for name, mask in masks.items()}


def _gap(corners: Array, o: Array, d: Array) -> Array:
    """(n,) by how much rays miss triangles (n, 3, 3): the farthest edge that they pass on the wrong side."""
    values = edge_functions(o, d, corners)
    side = np.where(arrival(corners, o, d)[1] < 0, -1.0, 1.0)[:, None]
    ways = corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]]
    length = np.linalg.norm(np.cross(d[:, None], ways), axis=2)
    return np.asarray((-side * values / np.where(length > 0, length, 1)).max(axis=1, initial=0))


@once_a_scene
def _their_answers(case: Case) -> Answers:
    rays = aimed(case).rays
    hits = case.bench.mitsuba.intersect(rays.o, rays.d)
    return Answers(hits.shape, hits.primitive, hits.t * np.linalg.norm(rays.d, axis=1))


def compare_seams(case: Case) -> Outcome:
    """Who lets rays through, or makes triangles too large; in the way of some stands something else."""
    aim, theirs = aimed(case), _their_answers(case)
    hits = case.intersect(aim.rays)
    ours = Answers(hits.shape, hits.primitive, hits.t)
    own, other = Faults.of(case, aim, ours, case.epsilon), Faults.of(case, aim, theirs, SINGLE)
    doubtful = np.isinf(aim.t)
    rays = int((~doubtful & ~(own.before & other.before)).sum())
    allowed = share_of("mitsuba corners", rays)
    broken = own.wrong.any(), other.wrong.sum() > allowed
    guilty: Guilty = "both" if all(broken) else "ours" if broken[0] else "mitsuba" if broken[1] else ""
    differing = tuple(
        replay(case, aim.rays, k, (ours.at(k), theirs.at(k), f"meets the surface at t = {aim.t[k]:.9g}"))
        for k in (np.flatnonzero((own if broken[0] else other).wrong)[:LISTED] if guilty else ())
    )
    return Outcome(
        term="edges and corners",
        scene=case.scene.name,
        precision=case.precision,
        backend=case.backend,
        rays=rays,
        measured=float(own.wrong.sum()),
        allowed=0.0,
        unit="rays",
        excluded=int(doubtful.sum()),
        excluded_allowed=share_of("grazing rays", len(doubtful)),
        ours_error=float(own.wrong.sum()),
        ours_allowed=0.0,
        mitsuba_error=float(other.wrong.sum()),
        mitsuba_allowed=float(allowed),
        guilty=guilty,
        worst=differing[0] if differing else None,
        differing=differing,
        figures=own.figures("ours") | other.figures("Mitsuba"),
    )


def terms() -> list[Term]:
    """The one term."""
    compares = "rays aimed at edges and corners of meshes: none may pass"
    return [Term("edges and corners", compares, partial(has_kind, MESH), compare_seams)]
