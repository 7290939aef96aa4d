"""Two quads A and B that share an edge at any angle, and what is true of rays that start on one of them.

In the plane across the edge a ray that leaves A at distance x from the edge, at the angle phi from A's own
direction, meets B, which stands at the angle w on that side, exactly when w < pi and phi > w: whatever x
is, even 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from reference.tolerances import TOLERANCES, bound
from tests.accuracy.probe import Bounce, bounce, compiled, rotation

Array = np.ndarray
EDGE = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class Wedge:
    """`theta`: angle from A to B; `frame`: rotation, `center`: middle of the shared edge, which is 2 `size`
    long."""

    theta: float
    frame: Array
    center: Array
    size: float

    def along(self, face: int, angle: Array) -> Array:
        """Unit vectors (n, 3) across the edge, at an angle counterclockwise from A (face 0) or B (face 1)."""
        angle = angle + (self.theta if face else 0.0)
        return np.stack([np.cos(angle), np.zeros_like(angle), np.sin(angle)], axis=1)

    def opening(self, face: int, side: Array) -> Array:
        """The angle between the faces on a side: +1 is counterclockwise."""
        return np.where((side > 0) == (face == 0), self.theta, 2 * np.pi - self.theta)

    def mesh(self, rng: np.random.Generator) -> dict[str, Any]:
        """Four triangles, wound and cut at random."""
        b = 2 * self.along(1, np.zeros(1))[0]
        corners = [[0, -1, 0], [0, 1, 0], [2, 1, 0], [2, -1, 0], [b[0], 1, b[2]], [b[0], -1, b[2]]]
        faces: list[list[int]] = []
        for p, q, r, s in ((0, 1, 2, 3), (0, 1, 4, 5)):
            cut = [[p, q, r], [p, r, s]] if rng.integers(2) else [[p, q, s], [q, r, s]]
            faces += [face[::-1] for face in cut] if rng.integers(2) else cut
        vertices = self.size * np.array(corners) @ self.frame.T + self.center
        return {"kind": "mesh", "vertices": np.float32(vertices).tolist(), "faces": faces}


@dataclass
class Tally:
    """What came of many rays."""

    rays: int = 0
    false_hits: int = 0
    lost: int = 0
    shadows: int = 0
    error: float = 0.0
    example: str = ""


def try_wedge(degrees: float, trials: int, rays: int, offset: float, precision: str = "single") -> Tally:
    """Rays from both faces, both sides and through, 1e-7 to 1e-1 of the size from the edge.

    The truth is that of the wedge before its vertices were rounded to single precision, so distances agree
    to single precision whatever that of the rays is.
    """
    tally = Tally()
    for trial in range(trials):
        rng = np.random.default_rng([trial, int(degrees * 8)])
        size = 10 ** rng.uniform(-2, 2)
        wedge = Wedge(np.radians(degrees), rotation(rng), rng.uniform(-1, 1, 3) * offset * size, size)
        device = compiled({"shapes": [wedge.mesh(rng)]}, precision)
        for crosses in (False, True):
            for face in (0, 1):
                _bounce_off(wedge, device, rng, rays, face, crosses, tally)
    return tally


def _bounce_off(
    wedge: Wedge,
    device: Any,
    rng: np.random.Generator,
    n: int,
    face: int,
    crosses: bool,
    tally: Tally,
) -> None:
    size, extent = wedge.size, np.abs(wedge.center).max() + 6 * wedge.size
    start = 10 ** rng.uniform(-7, -1, n)[:, None] * size * wedge.along(face, np.zeros(n))
    start += rng.uniform(-0.9, 0.9, n)[:, None] * size * EDGE
    side = rng.choice([1, -1], n)
    opening_in = wedge.opening(face, side)
    phi_in, y_in = rng.uniform(0, 1, n) * np.minimum(opening_in, np.pi), rng.uniform(-0.8, 0.8, n)
    back = _tilted(wedge.along(face, side * phi_in), y_in)
    side = -side if crosses else side
    opening, phi, y = wedge.opening(face, side), rng.uniform(0, np.pi, n), rng.uniform(-0.95, 0.95, n)
    d = _tilted(wedge.along(face, side * phi), y)
    to_world = wedge.frame.T
    o = (start + 1.5 * size * back) @ to_world + wedge.center
    found = bounce(device, o, -back @ to_world, d @ to_world, crosses, 50 * size)

    doubt = max(1e-3, 4 * bound("position", "single", extent) / size)
    steep = np.sin(phi_in) * np.sqrt(1 - y_in**2) > TOLERANCES["arrival cosine"].value
    used = found.valid & (found.primitive // 2 == face) & steep & (np.minimum(phi, np.pi - phi) > doubt)
    used &= np.abs(phi - opening) > doubt
    p = (found.p - wedge.center) @ wedge.frame
    x = np.maximum((p * wedge.along(face, np.zeros(n))).sum(axis=1), 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = x * np.sin(opening) / np.sin(phi - opening) / np.sqrt(1 - y**2)
        reach = np.maximum(x * np.sin(phi) / np.sin(phi - opening) / 2, np.abs(p[:, 1] + y * t)) / size
    meets = (phi > opening) & (opening < np.pi)
    noise = bound("position", "single", extent) / size * (1 + reach) / np.abs(np.sin(phi - opening))
    used &= ~meets | (np.abs(reach - 1) > 2 * doubt + noise)
    cosine = np.abs(np.sin(phi - opening)) * np.sqrt(1 - y**2)
    unit = bound("contact distance", "single", extent) / TOLERANCES["contact distance"].value
    _count(tally, found, used, meets & (reach < 1), np.where(meets, t, 0), cosine / unit, face)
    if not tally.example and tally.false_hits + tally.lost:
        tally.example = f"face {face}, crosses {crosses}, size {size}, " + tally.example


def _count(
    tally: Tally, found: Bounce, used: Array, meets: Array, t: Array, per_unit: Array, face: int
) -> None:
    """`per_unit`: turns a difference of t into multiples of eps S."""
    hit = found.next_valid
    other = hit & (found.next_primitive // 2 == 1 - face)
    error = np.where(used & meets & other, np.abs(np.where(hit, found.t, 0) - t) * per_unit, 0)
    right = other & (error <= TOLERANCES["contact distance"].value)
    tally.error = max(tally.error, float(np.where(right, error, 0).max()))
    lost, false_hit = used & meets & ~right, used & ~meets & hit
    tally.rays += int(used.sum())
    tally.lost += int(lost.sum())
    tally.false_hits += int(false_hit.sum())
    tally.shadows += int((used & (found.blocked != meets)).sum())
    wrong = lost | false_hit
    if wrong.any() and not tally.example:
        k = int(np.argmax(wrong))
        tally.example = (
            f"from {found.p[k].tolist()} on triangle {found.primitive[k]}: met triangle "
            f"{found.next_primitive[k]} at "
            f"{found.t[k]}, truth {t[k] if meets[k] else 'nothing'}"
        )


def _tilted(across: Array, y: Array) -> Array:
    return across * np.sqrt(1 - y**2)[:, None] + y[:, None] * EDGE
