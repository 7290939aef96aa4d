"""All tolerances of the accuracy suite in one table: the name, the value, why it is so large, and where it
comes from.

Units: `eps` is the unit roundoff, 2^-24 in single and 2^-53 in double precision; S is the largest
|coordinate| of the scene, ray origins included; theta the angle between a ray and the normal of what it
hits.
"""

from __future__ import annotations

from typing import NamedTuple

EPSILON = {"single": 2.0**-24, "double": 2.0**-53}


class Tolerance(NamedTuple):
    """One row of the table; `source` is a section of the document or the measurement behind the number."""

    value: float
    unit: str
    reason: str
    source: str


TOLERANCES: dict[str, Tolerance] = {
    "distance": Tolerance(
        16,
        "eps S",
        "|dt cos theta|: o, d and the plane's d are rounded once each, n.o and n.d add 6 products",
        "5",
    ),
    "position": Tolerance(
        16,
        "eps S",
        "|dp.n| and |dp| cos: the point is o + t d with the error of t, put back onto its surface, which "
        "costs one n.p",
        "5",
    ),
    "normal": Tolerance(
        16, "eps S / (r cos theta)", "a sphere's normal turns by dp / r, and dp along the surface is dt", "5"
    ),
    "color, double": Tolerance(
        1e-9,
        "display value",
        "eps S times the gain of 20 bounces on curved mirrors (up to 1e3 each way)",
        "9",
    ),
    "color, single": Tolerance(1e-4, "display value", "a fortieth of a step of 8 bits, away from edges", "9"),
    "depth, double": Tolerance(1e-11, "S", "16 eps S at cos theta > 2e-4", "7"),
    "edge pixels": Tolerance(
        0.08,
        "share",
        "pixels whose double-precision color moves with single rounding of the canvas",
        "measured",
    ),
    "differing rays": Tolerance(
        0.002, "share", "single: a ray whose branch rounding decides may be counted otherwise", "measured"
    ),
    "color, Mitsuba": Tolerance(
        1e-4, "display value", "the tolerance of single precision, which both pictures are made in", "9"
    ),
    "grazing pixels": Tolerance(
        0.01,
        "share",
        "differ, and move with rounding of the canvas or with where the reference starts secondary rays",
        "measured",
    ),
    "white": Tolerance(
        4, "ulp of 1", "shares w / sum w, the sum of D and H, and a + (1-a) x round once each", "2"
    ),
    "moved": Tolerance(
        4,
        "eps (S + 2000) / r",
        "moved by 2000 every coordinate is rounded to eps (S + 2000); a normal turns by that over the "
        "radius r, the direction to a light by less, and a cosine by at most both",
        "5",
    ),
    "contact distance": Tolerance(32, "eps S", "|dt cos theta| from a start that is itself 8 eps S off", "5"),
    "arrival cosine": Tolerance(
        0.25,
        "cosine",
        "a ray that arrives at a smaller angle knows where it is along the surface only to eps S / "
        "cosine, which is "
        "more than the 8 eps S of the contact rules",
        "5",
    ),
    "doubtful": Tolerance(0.08, "share", "rays whose truth rounding of the start decides", "measured"),
    "fronting": Tolerance(1e-3, "rad", "both faces of an edge front the ray by more than this", "5"),
    "grazing band": Tolerance(
        16,
        "eps S",
        "clearance of a ray from a silhouette, an edge or a tie: o, d, center and radius are rounded once "
        "each on either side, and the closest approach adds 6 products",
        "4, 5",
    ),
    "grazing rays": Tolerance(
        0.0005,
        "share",
        "rays that differ in the grazing band; 2 % of the free rays are aimed within 1e-4 r of silhouettes; "
        "measured up to 1.2e-4 in half a million rays, 2.8e-4 in 18,000",
        "measured",
    ),
    "placement": Tolerance(
        4,
        "eps S",
        "turning and scaling cost 5 products in double precision; spheres and planes are rounded once to the "
        "precision of the tables, vertices to single precision, where neighbors may round apart",
        "5, 4",
    ),
    "direct light": Tolerance(
        32,
        "eps (1 + S / d)",
        "D = sum w V (n.l), of the same points and normals: l is known to eps S / d, d the distance of the "
        "nearest sample; w are rounded once, and add up to 1",
        "2",
    ),
    "lit points": Tolerance(
        0.005,
        "share",
        "points that differ by samples in the grazing band: each has up to 64 of them",
        "measured",
    ),
    "canvas moves": Tolerance(
        504,
        "eps S",
        "largest move of the canvas that must change a pixel which may differ: three times the shift 1e-5 of "
        "the borders of texture cells, for surfaces oblique to all axes",
        "6",
    ),
    "start moves": Tolerance(
        16,
        "factor",
        "largest other start of the reference's secondary rays: one that leaves a triangle at a cosine of "
        "1e-3 may meet it once more beyond the usual start",
        "measured",
    ),
    "edge on": Tolerance(
        1e-3,
        "cosine",
        "a pixel that sees its surface as flat may differ: the reference's point is off it by eps S, and a "
        "ray that leaves as flat meets it again eps S / 1e-3 from there, beyond its start",
        "measured",
    ),
    "normal edge on": Tolerance(
        1e-4,
        "cosine",
        "an interpolated normal seen so flat: rounding decides whether it faces the ray, and counts",
        "5",
    ),
    "horizon": Tolerance(
        1e4,
        "S",
        "planes may be missed beyond it: a disk stands for a plane in Mitsuba, and ends at 1e5 S",
        "measured",
    ),
    "start step": Tolerance(
        1e-5,
        "S",
        "Mitsuba's rays start so far along themselves, so that they do not meet again what they leave; at "
        "1e-6 some do",
        "measured",
    ),
    "far points": Tolerance(
        4,
        "S",
        "points farther away are not asked what they see: both sides scale their guards by the farthest",
        "4",
    ),
    "left out": Tolerance(
        0.04,
        "share",
        "rays that agree on what they hit but graze its rim or edge, or start next to a neighbor: there a "
        "distance, a side or a normal means nothing; 2 % of the free rays are aimed within 1e-4 r of "
        "silhouettes, and in the band of a small sphere all of them; measured up to 2.4 %",
        "measured",
    ),
    "mitsuba sphere": Tolerance(
        4, "eps S", "|dt cos|: the re-centered quadratic in single precision; measured 1.6", "measured"
    ),
    "mitsuba plane": Tolerance(
        8,
        "eps S",
        "|dt cos|: a disk's matrix is rounded once, o and d are taken into its frame, 6 products each; "
        "measured 3.8",
        "measured",
    ),
    "mitsuba mesh": Tolerance(
        8,
        "eps S |e1||e2| / |e1 x e2|",
        "|dt cos|: Embree's normal is a cross product of rounded edges; measured 3.3",
        "measured",
    ),
    "mitsuba corners": Tolerance(
        0.01,
        "share",
        "rays aimed at edges and corners that Embree lets through, its robust mode too; all of them at "
        "corners, most from far away; measured 0.0044",
        "measured",
    ),
    "mitsuba normal": Tolerance(
        8,
        "eps S / (r cos), flat: eps |e1||e2| / |e1 x e2|",
        "dp / r for spheres; a cross product and its length for triangles; measured 2.2",
        "measured",
    ),
    "camera": Tolerance(
        16,
        "eps S, eps",
        "o = K + x X + y Y and d = unit(dis f + x X + y Y): 3 products each, S of the canvas",
        "7",
    ),
    "mitsuba camera": Tolerance(
        8,
        "eps S, eps",
        "fov, frame and principal point are rounded once each, the sample goes through a 4 x 4 matrix; "
        "measured 3.2",
        "measured",
    ),
    "depth buffer": Tolerance(
        16, "eps S", "|dt cos|, camera ray and hit together, 8 each; measured 4.0 in single precision", "7"
    ),
    "mitsuba depth buffer": Tolerance(
        16,
        "eps S",
        "|dt cos|: 8 of the hit, and 8 of the camera ray, whose near plane is taken off t; measured 4.7",
        "measured",
    ),
    "mirror": Tolerance(
        16, "eps (1 + 2 S / r)", "5 products; a normal known to eps S / r turns the ray twice as far", "3"
    ),
    "refraction": Tolerance(
        16,
        "eps (1 + (eta + eta^2) / sqrt k + (S / r) g (1 + eta / sqrt k)), g = |eta c - sqrt k|",
        "sqrt k loses eps eta^2 / sqrt k near total reflection; a normal known to eps S / r changes the ray "
        "by g (1 + eta / sqrt k) times that",
        "3",
    ),
    "mitsuba direction": Tolerance(
        16,
        "as mirror and refraction, at the same normal",
        "into the frame of the normal and out of it, 6 products each way",
        "measured",
    ),
    "total reflection band": Tolerance(
        16, "eps (1 + eta^2) (1 + 2 S / r)", "rounding of k = 1 - eta^2 (1 - c^2) and of the normal", "3"
    ),
    "next vertex": Tolerance(
        16, "eps S", "|dt cos| from the vertex and direction that our chain reports, taken at their word", "5"
    ),
    "mitsuba next vertex": Tolerance(
        8, "eps S", "|dt cos|: one hit from a start of its own, as for primary rays", "measured"
    ),
    "chain growth": Tolerance(
        16,
        "eps S / cos times the gain of the bounces, 1 + 2 t / (r cos) each",
        "median over chains that run freely; each side adds the error of one hit a vertex",
        "measured",
    ),
}


def bound(name: str, precision: str = "double", extent: float = 1.0) -> float:
    """The tolerance as a number: rows in `eps S` need the precision and S."""
    row = TOLERANCES[name]
    return row.value * EPSILON[precision] * extent if row.unit.startswith("eps") else row.value
