"""Terms of the depth buffer: what each pixel shows, and how far away it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reference.comparison.case import Case, once_a_case, roundness, sizes, truth_of_hits
from reference.comparison.decisions import Answers, free_questions, judge_ids
from reference.comparison.hits import rim_clearance
from reference.comparison.judge import SINGLE, Numbers, bounds, judge_numbers
from reference.comparison.kinds import has_shapes
from reference.comparison.records import Outcome, Panels, Term
from reference.comparison.renders import render_of, small_mitsuba
from reference.tolerances import TOLERANCES

Array = np.ndarray


class DepthBuffers:
    """The depth buffers of both sides of a small picture, pixel by pixel, and Mitsuba's hits there."""

    def __init__(self, case: Case) -> None:
        render = render_of(case)
        self.scene, self.rays, result = render.scene, render.rays, render.result
        self.picture, self.ours = result.depth, result.depth.ravel().astype(np.float64)
        self.shape = result.aovs["shape"].ravel().astype(np.int64)
        self.primitive = result.aovs["primitive"].ravel().astype(np.int64)
        theirs = small_mitsuba(case)
        self.theirs = theirs.depth_buffer().ravel()
        self.hits = theirs.intersect(*theirs.camera_rays())


@once_a_case
def depth_buffers(case: Case) -> DepthBuffers:
    """The buffers of a case."""
    return DepthBuffers(case)


def compare_mask(case: Case) -> Outcome:
    """What each pixel shows: shape and primitive of our layers against Mitsuba's hits, and blank pixels of
    Mitsuba's depth integrator."""
    b = depth_buffers(case)
    blank = b.theirs < 0
    ours = Answers(b.shape, b.primitive, b.ours)
    theirs = Answers(np.where(blank, -1, b.hits.shape), np.where(blank, -1, b.hits.primitive), b.theirs)
    asked = free_questions(case, b.rays, ours, theirs)
    outcome = judge_ids(case, "depth buffer, mask", asked, "grazing pixels")
    size = b.picture.shape
    panels = Panels("depth", b.picture, b.theirs.reshape(size), ours.differ(theirs).reshape(size))
    return replace(outcome, panels=panels)


def compare_depth(case: Case) -> Outcome:
    """|dt cos| of the pixels where both sides show the same primitive, in eps S."""
    b, truth = depth_buffers(case), case.bench.truth
    k = np.flatnonzero((b.shape >= 0) & (b.theirs >= 0) & (b.shape == b.hits.shape))
    k = k[b.primitive[k] == b.hits.primitive[k]]
    t, normal = truth_of_hits(truth, b.rays.part(k), b.shape[k], b.primitive[k])
    cosine = np.abs((normal * b.rays.d[k]).sum(axis=1))
    radius, condition = roundness(truth, b.shape[k], b.primitive[k])
    extent = sizes(truth, b.rays.o[k], b.rays.o[k] + t[:, None] * b.rays.d[k])
    # Both sides make rays of their own, so their rims lie farther apart than those of one ray.
    clear = rim_clearance(radius, cosine) > 2 * TOLERANCES["grazing band"].value * SINGLE * extent
    left_out = int((~clear).sum())
    k, t, cosine, condition, extent = (a[clear] for a in (k, t, cosine, condition, extent))
    unit = extent / cosine
    # Mitsuba's rays come from the eye, so its place counts among the coordinates.
    eye = b.rays.o[k] - b.scene.camera.eye_distance * b.rays.d[k]
    their_unit = SINGLE * sizes(truth, eye, b.rays.o[k]).clip(min=extent) / cosine * condition
    numbers = Numbers(
        rays=b.rays,
        index=k,
        difference=np.abs(b.ours[k] - b.theirs[k]) / their_unit,
        ours=np.abs(b.ours[k] - t) / (case.epsilon * unit),
        mitsuba=np.abs(b.theirs[k] - t) / their_unit,
        unit="eps S / cos",
        answers=lambda i: (f"depth {b.ours[k[i]]!s}", f"depth {b.theirs[k[i]]!s}", f"depth {t[i]!s}"),
        ulp=(case.ulps(b.ours[k] - t, t), case.bench.ulps(b.theirs[k] - t, t)),
        left_out=left_out,
    )
    return judge_numbers(case, "depth buffer", numbers, bounds(case, "depth buffer", "mitsuba depth buffer"))


def terms() -> list[Term]:
    """The mask of the depth buffer, and its depths."""
    return [
        Term(
            "depth buffer, mask", "which pixels are blank, and what the others show", has_shapes, compare_mask
        ),
        Term("depth buffer", "distance from the canvas, as a picture", has_shapes, compare_depth),
    ]
