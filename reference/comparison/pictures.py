"""The term of whole pictures: ours against the document's formula on Mitsuba's hits.

Two programs, two ways to avoid self-hits, one model. A pixel may differ where a decision is grazing (a
silhouette, an edge, the border of a shadow or of a texture's cell), see `doubt.py`. Such pixels are counted.
"""

from __future__ import annotations

import numpy as np

from reference import extended, whitted
from reference.comparison.case import Case, once_a_scene
from reference.comparison.decisions import LISTED
from reference.comparison.doubt import doubt
from reference.comparison.judge import replay, samples, share_of
from reference.comparison.kinds import has_shapes
from reference.comparison.records import Guilty, Outcome, Panels, Replay, Term
from reference.comparison.renders import distance, render_of
from reference.comparison.second_version import plain_pixels
from reference.tolerances import TOLERANCES
from tracer.compare import compare_pictures

Array = np.ndarray


def compare_with_mitsuba(case: Case) -> Outcome:
    """Every color of ours against the document's formula on Mitsuba's hits, visibility and directions."""
    ours, theirs, rays = render_of(case).result, their_picture(case), render_of(case).rays
    apart = distance(ours.color, ours.depth, theirs.color, theirs.depth)
    allowed = TOLERANCES["color, Mitsuba"].value
    differs, doubtful = apart > allowed, in_doubt(case, apart)
    excused = differs & doubtful
    order = np.concatenate([np.flatnonzero(differs & ~excused), np.flatnonzero(excused)])[:LISTED]
    outside = order[~excused.flat[order]]
    guilty, opinions = second_opinion(case, outside)
    sure = np.where(doubtful, 0, apart)
    worst = int(np.argmax(sure))

    def at(k: int) -> Replay:
        own, other = (f"color {c.reshape(-1, 3)[k].tolist()}" for c in (ours.color, theirs.color))
        answers = (own, other, opinions.get(k, "not asked"))
        return replay(case, rays, k, answers, bool(excused.flat[k]))

    found = compare_pictures(ours.color, theirs.color)
    kept, silhouette = samples(case, rays, np.arange(apart.size), worst)
    return Outcome(
        term="picture, Mitsuba",
        scene=case.scene.name,
        precision=case.precision,
        backend=case.backend,
        rays=apart.size,
        measured=float(sure.max()),
        allowed=allowed,
        unit="display value",
        excluded=int(excused.sum()),
        excluded_allowed=share_of("grazing pixels", apart.size),
        guilty=guilty,
        worst=at(worst),
        samples=apart.ravel()[kept],
        distance_to_silhouette=silhouette,
        differing=tuple(at(int(k)) for k in order),
        panels=Panels("color", ours.color, theirs.color, differs),
        figures={
            "\u0394E2000 mean": found.delta_e_mean,
            "\u0394E2000 max": found.delta_e_max,
            "RMS": found.rms,
        },
    )


def in_doubt(case: Case, apart: Array) -> Array:
    """(h, w) which of the pixels that are `apart` by a good part of what is allowed rounding decides: the
    reference's own colors move at least half as far; or what they show is seen edge on, as at the horizon of
    a plane."""
    large = apart > TOLERANCES["color, Mitsuba"].value / 10
    if not large.any():
        return large
    moves = doubt_of(case) >= apart / 2
    k = np.flatnonzero(large)
    edge_on = np.zeros(large.size, bool)
    edge_on[k] = cosine_of_arrival(case, k) < TOLERANCES["edge on"].value
    return np.asarray(large & (moves | edge_on.reshape(large.shape)))


def cosine_of_arrival(case: Case, pixels: Array) -> Array:
    """(k,) |cosine| between rays and normals of what pixels (numbers, row by row) show; 1 where nothing."""
    render, truth = render_of(case), case.bench.truth
    shape, primitive = (render.result.aovs[name].ravel()[pixels] for name in ("shape", "primitive"))
    cosine = np.ones(len(pixels))
    k = np.flatnonzero(render.result.depth.ravel()[pixels] >= 0)
    rays = render.rays.part(pixels[k])
    p = rays.o + render.result.depth.ravel()[pixels[k], None] * rays.d
    normal = truth.outward(p, shape[k].astype(np.int64), primitive[k].astype(np.int64))
    cosine[k] = np.abs((extended.double(normal) * rays.d).sum(axis=1))
    return cosine


@once_a_scene
def their_picture(case: Case) -> whitted.Picture:
    """The picture on Mitsuba's hits."""
    return whitted.render(case.bench.small, supersample=1)


@once_a_scene
def doubt_of(case: Case) -> Array:
    """(h, w) by how much the colors of that picture move where rounding decides."""
    return doubt(case.bench.small, case.bench.mitsuba.extent, 1)


def second_opinion(case: Case, pixels: Array) -> tuple[Guilty, dict[int, str]]:
    """Who is off the plain version at some pixels (numbers, row by row), and what that shows there."""
    if not len(pixels):
        return "", {}
    theirs, ours = their_picture(case), render_of(case).result
    truth, depth = plain_pixels(case.bench.small, pixels)
    allowed = TOLERANCES["color, Mitsuba"].value
    wrong = []
    for side in (ours, theirs):
        color, own = side.color.reshape(-1, 3)[pixels], side.depth.ravel()[pixels]
        off = np.abs(color - truth).max(axis=1) > allowed
        wrong.append(bool((off | ((own < 0) != (depth < 0))).any()))
    guilty: Guilty = "both" if all(wrong) else "ours" if wrong[0] else "mitsuba" if wrong[1] else "unknown"
    return guilty, {int(k): f"(plain) color {color}" for k, color in zip(pixels, truth, strict=True)}


def terms() -> list[Term]:
    """The one term."""
    compares = "the document's formula on Mitsuba's hits, every pixel"
    return [Term("picture, Mitsuba", compares, has_shapes, compare_with_mitsuba)]
