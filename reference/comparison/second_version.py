"""Terms of the plain version: colors, and rays counted by kind, of a very small picture.

The plain version shares nothing with the tracer and traces in double precision, a ray after the other; so the
picture has only as many pixels as it can do in about a second.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import tracer
from reference import plain
from reference.comparison.case import Case, once_a_case, once_a_scene, small_picture
from reference.comparison.decisions import LISTED
from reference.comparison.doubt import doubt
from reference.comparison.judge import replay, share_of
from reference.comparison.kinds import has_shapes
from reference.comparison.records import Outcome, Replay, Term
from reference.comparison.renders import distance, pixel_centers
from reference.tolerances import TOLERANCES
from reference.whitted_tables import plain_world

Array = np.ndarray

MOST_PIXELS, LEAST_PIXELS = 600, 6
"""Pixels of a scene without meshes, and of one with very many triangles."""

TRIANGLES_A_PIXEL = 40
"""So many triangles cost the plain version as much as all else of a pixel."""

COUNTED = ("total_internal", "ended_by_cutoff", "ended_by_depth", "deepest_level")


def plain_pixels(scene: tracer.Scene, pixels: Array) -> tuple[Array, Array]:
    """(k, 3) colors of some pixels (numbers, row by row), one ray each, and their depths (k,), -1 blank."""
    world, width = plain_world(scene), scene.camera.resolution[0]
    places = ((int(k) % width, int(k) // width) for k in pixels)
    pictures = [plain.render(world, supersample=1, crop=(x, y, x + 1, y + 1)) for x, y in places]
    colors = np.array([picture.color[0, 0] for picture in pictures]).reshape(-1, 3)
    return colors, np.array([picture.depth[0, 0] for picture in pictures])


@dataclass(frozen=True)
class Versions:
    """A very small picture of `scene` by both versions, ours in the precision of the case."""

    scene: tracer.Scene
    ours: tracer.Result
    theirs: plain.Picture


@once_a_scene
def plain_version(case: Case) -> tuple[tracer.Scene, plain.Picture]:
    """The scene with as few pixels as the plain version can do in about a second, and its picture."""
    share = TRIANGLES_A_PIXEL / (TRIANGLES_A_PIXEL + len(case.bench.truth.corners))
    scene = small_picture(case.bench.scene, max(LEAST_PIXELS, round(MOST_PIXELS * share)))
    return scene, plain.render(plain_world(scene), supersample=1)


@once_a_case
def versions(case: Case) -> Versions:
    """Both pictures."""
    scene, picture = plain_version(case)
    return Versions(scene, tracer.render(scene, case.precision, case.backend, supersample=1), picture)


def compare_colors(case: Case) -> Outcome:
    """Every color of ours against the plain version's. In single precision pixels may differ that rounding
    decides."""
    v = versions(case)
    row = TOLERANCES[f"color, {case.precision}"]
    apart = distance(v.ours.color, v.ours.depth, v.theirs.color, v.theirs.depth)
    differs = apart > row.value
    excused = np.zeros_like(differs)
    if differs.any() and case.precision == "single":
        excused = differs & (doubt(v.scene, case.bench.mitsuba.extent, 1) >= apart / 2)
    rays = pixel_centers(case, v.scene)
    order = np.flatnonzero(differs)
    order = order[np.argsort(excused.ravel()[order], kind="stable")]
    outside = order[~excused.ravel()[order]]

    def at(k: int) -> Replay:
        own, other = (f"color {c.reshape(-1, 3)[k].tolist()}" for c in (v.ours.color, v.theirs.color))
        return replay(case, rays, k, (own, "not asked", f"(plain) {other}"), bool(excused.flat[k]))

    return Outcome(
        term="picture, plain",
        scene=case.scene.name,
        precision=case.precision,
        backend=case.backend,
        rays=apart.size,
        measured=float(np.where(excused, 0, apart).max()),
        allowed=row.value,
        unit="display value",
        excluded=int(excused.sum()),
        excluded_allowed=share_of("edge pixels", apart.size),
        guilty="ours" if len(outside) else "",
        worst=at(int(outside[0] if len(outside) else np.argmax(apart))),
        differing=tuple(at(int(k)) for k in order[:LISTED]),
    )


def compare_counts(case: Case) -> Outcome:
    """How many rays of each kind were traced, and why paths ended: the largest difference."""
    v = versions(case)
    ours = v.ours.stats["rays"] | {key: v.ours.stats[key] for key in COUNTED}
    off = {kind: abs(ours[kind] - count) for kind, count in v.theirs.counts.items()}
    return Outcome(
        term="rays counted, plain",
        scene=case.scene.name,
        precision=case.precision,
        backend=case.backend,
        rays=sum(v.theirs.counts[kind] for kind in v.ours.stats["rays"]),
        measured=float(max(off.values())),
        allowed=0.0,
        unit="rays of a kind",
        guilty="ours" if any(off.values()) else "",
        figures={f"{kind} off by": float(value) for kind, value in off.items() if value},
    )


def terms() -> list[Term]:
    """Colors, and counts, which are equal in double precision only: in single precision rounding decides
    some pixels, and with them their rays."""
    counted = "rays by kind against the plain version"
    return [
        Term("picture, plain", "colors against the plain version", has_shapes, compare_colors),
        Term("rays counted, plain", counted, has_shapes, compare_counts, precisions=("double",)),
    ]
