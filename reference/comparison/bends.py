"""The mirrors and refractions of all chains, with closed forms of what they do to a direction."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from reference import extended
from reference.comparison.case import Case, once_a_case, sizes
from reference.comparison.rays import single
from reference.comparison.steps import Steps, agreed_steps
from reference.comparison.truth import MESH, SPHERE, Truth
from reference.tolerances import TOLERANCES

Array = np.ndarray


@dataclass(frozen=True)
class Bends:
    """The mirrors or refractions of all chains: the step of each, the normal (n, 3) that faces the ray and
    closed forms of the direction after it (NaN after total reflection), at the exact normal of our vertex;
    `k` = 1 - eta^2 (1 - c^2), `eta` and `curve` = S / r; `sure`: away from edges, rims and interpolated
    normals seen edge on."""

    steps: Steps
    normal: Array
    exact: Array
    k: Array
    eta: Array
    entering: Array
    curve: Array
    sure: Array

    def part(self, k: Array) -> Bends:
        """Some of them, by number or mask."""
        others = (getattr(self, f.name)[k] for f in fields(self) if f.name != "steps")
        return Bends(self.steps.part(k), *others)

    def asked(self) -> tuple[Array, Array, Array]:
        """What Mitsuba's materials are asked: directions and facing normals in single precision, and the
        normals outward."""
        d, n = single(extended.double(extended.unit(self.steps.d))), single(self.normal)
        return d, n, np.where(self.entering[:, None], n, -n)


@once_a_case
def bends(case: Case, refracts: bool) -> Bends:
    """The steps with that event; glass of index 1 is left out."""
    truth, (s, sure) = case.bench.truth, agreed_steps(case)
    wanted = (s.refracts == refracts) & (~s.refracts | (truth.ior[s.shape] != 1))
    s, sure = s.part(wanted), sure[wanted]
    d = extended.unit(s.d)
    normal, entering, cosine = truth.shading(s.p, d, s.shape, s.primitive)
    ior = extended.number(truth.ior[s.shape])
    eta = np.where(entering, 1 / ior, ior)
    if refracts:
        exact, k = extended.refract(d, normal, eta)
    else:
        exact, k = extended.mirror(d, normal), extended.number(np.ones(len(cosine)))
    curve = sizes(truth, s.o, s.p) / bend_radius(truth, s.shape, s.primitive)
    columns = (extended.double(normal), extended.double(exact), extended.double(k), extended.double(eta))
    return Bends(s, *columns, entering, curve, sure & (cosine > TOLERANCES["normal edge on"].value))


def bend_radius(truth: Truth, shape: Array, primitive: Array) -> Array:
    """(n,) the length over which the normal turns: a sphere's radius, the least height of a triangle with
    interpolated normals; infinite for flat ones."""
    radius = np.full(len(shape), np.inf)
    ball = truth.kind[shape] == SPHERE
    radius[ball] = truth.rows[shape[ball], 3]
    k = np.flatnonzero((truth.kind[shape] == MESH) & ~truth.flat[shape])
    c = truth.triangles(shape[k], primitive[k])
    sides = np.stack([c[:, 1] - c[:, 0], c[:, 2] - c[:, 1], c[:, 0] - c[:, 2]], axis=1)
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    radius[k] = area / np.linalg.norm(sides, axis=2).max(axis=1, initial=0)
    return radius


def total_band(b: Bends, epsilon: float) -> Array:
    """|k| below which rounding decides whether there is total reflection."""
    width = TOLERANCES["total reflection band"].value * epsilon
    return np.asarray(width * (1 + b.eta**2) * (1 + 2 * b.curve))
