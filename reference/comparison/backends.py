"""Terms of the GPU: our hits on CUDA against ours on LLVM, in the bands of the comparison with Mitsuba."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import tracer
from reference.comparison.case import Case, roundness, truth_of_hits
from reference.comparison.decisions import Answers, free_questions, judge_ids
from reference.comparison.hits import rim_clearance
from reference.comparison.judge import SINGLE, Bounds, Numbers, judge_numbers
from reference.comparison.records import Guilty, Outcome, Term
from reference.tolerances import TOLERANCES
from tracer.backends import has_cuda

Array = np.ndarray

FIRST, SECOND = "cuda", "llvm"
NAMES: dict[Guilty, Guilty] = {"ours": "cuda", "mitsuba": "llvm"}


def hits_on(case: Case, backend: str) -> tracer.Hits:
    """Our hits of the rays of the bench, on a backend."""
    rays = case.bench.rays
    return tracer.intersect(case.bench.scene, rays.o, rays.d, precision=case.precision, backend=backend)


def compare_hits(case: Case, first: str = FIRST, second: str = SECOND) -> Outcome:
    """Hit mask, shape and primitive of every ray on both backends."""
    rays, a, b = case.bench.rays, hits_on(case, first), hits_on(case, second)
    one, other = (Answers(hits.shape, hits.primitive, hits.t) for hits in (a, b))
    asked = free_questions(case, rays, one, other)
    found = judge_ids(case, "CUDA against LLVM, hits", asked)
    return _named(found, first, second)


def compare_distances(case: Case, first: str = FIRST, second: str = SECOND) -> Outcome:
    """|dt cos| where both backends hit the same primitive, in eps S."""
    rays, truth, a, b = case.bench.rays, case.bench.truth, hits_on(case, first), hits_on(case, second)
    k = np.flatnonzero(a.valid & (a.shape == b.shape) & (a.primitive == b.primitive))
    shape, primitive = a.shape[k], a.primitive[k]
    t, normal = truth_of_hits(truth, rays.part(k), shape, primitive)
    d = rays.d[k] / np.linalg.norm(rays.d[k], axis=1, keepdims=True)
    cosine = np.abs((normal * d).sum(axis=1))
    unit = case.extents[k] / np.maximum(cosine, 1e-300)
    band = TOLERANCES["grazing band"].value * SINGLE * case.extents[k]
    clear = np.flatnonzero(rim_clearance(roundness(truth, shape, primitive)[0], cosine) > band)
    k, t, unit = k[clear], t[clear], unit[clear]
    off, other_off, apart = (
        np.abs(error) / (case.epsilon * unit) for error in (a.t[k] - t, b.t[k] - t, a.t[k] - b.t[k])
    )
    allowed = TOLERANCES["distance"].value
    numbers = Numbers(
        rays=rays,
        index=k,
        difference=apart,
        ours=off,
        mitsuba=other_off,
        unit="eps S / cos",
        answers=lambda i: (f"t = {a.t[k[i]]!s}", f"t = {b.t[k[i]]!s}", f"t = {t[i]!s}"),
    )
    found = judge_numbers(case, "CUDA against LLVM, distance", numbers, Bounds(allowed, allowed, allowed))
    return _named(found, first, second)


def _named(outcome: Outcome, first: str, second: str) -> Outcome:
    """Both sides are ours here: their backends stand for their names."""
    return replace(outcome, backend=f"{first} and {second}", guilty=NAMES.get(outcome.guilty, outcome.guilty))


def applies(scene: tracer.Scene) -> bool:
    """Whether there is a GPU, and something to hit."""
    return bool(scene.shapes) and has_cuda()


def terms() -> list[Term]:
    """Hits and distances."""
    return [
        Term("CUDA against LLVM, hits", "our hits on the GPU and on the processor", applies, compare_hits),
        Term(
            "CUDA against LLVM, distance",
            "our distances on the GPU and on the processor",
            applies,
            compare_distances,
        ),
    ]
