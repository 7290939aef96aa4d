"""A ray that leaves a sphere, a plane or a triangle does not hit it again, at any scale."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.accuracy.probe import bounce, compiled, directions

KINDS = ("sphere", "plane", "triangle")


def random_shape(kind: str, rng: np.random.Generator) -> tuple[dict[str, Any], np.ndarray, float]:
    """A shape of a size from 1e-4 to 1e4 up to ten sizes from the origin, its middle, its size."""
    size = 10 ** rng.uniform(-4, 4)
    center = directions(rng, 1)[0] * size * rng.uniform(0, 10)
    if kind == "sphere":
        return {"kind": "sphere", "center": center.tolist(), "radius": size}, center, size
    if kind == "plane":
        n = directions(rng, 1)[0]
        return {"kind": "plane", "coefficients": [*n.tolist(), float(-n @ center)]}, center, size
    corners = center + size * directions(rng, 3)
    return {"kind": "mesh", "vertices": corners.tolist(), "faces": [[0, 1, 2]]}, corners.mean(0), size


def check(kind: str, shapes: int, rays: int, precision: str) -> None:
    """Bounced rays leave on the side that they came from and never come back; through a sphere they meet it
    once."""
    for number in range(shapes):
        rng = np.random.default_rng([number, len(kind)])
        shape, middle, size = random_shape(kind, rng)
        device = compiled({"shapes": [shape]}, precision)
        d_in, d_out = directions(rng, rays), directions(rng, rays)
        o = middle + 0.3 * size * directions(rng, rays) - 3 * size * d_in
        for crosses in (False, True):
            found = bounce(device, o, d_in, d_out, crosses, 1e3 * size)
            side = (
                (found.outward * d_out).sum(axis=1) * np.where(found.entering, 1, -1) * (-1 if crosses else 1)
            )
            used = found.valid & (side > 1e-4)
            assert used.any()
            inside = used & (found.entering == crosses) if kind == "sphere" else np.zeros(rays, bool)
            wrong = used & (found.next_valid != inside)
            if kind == "sphere":
                chord = -2 * ((found.p - middle) * d_out).sum(axis=1)
                wrong |= (
                    inside & found.next_valid & ~(np.abs(np.where(inside, found.t, 0) - chord) < 1e-3 * size)
                )
            if wrong.any():
                k = int(np.argmax(wrong))
                expected = "its far side" if inside[k] else "nothing"
                pytest.fail(
                    f"{int(wrong.sum())} of {int(used.sum())} rays; {kind} {number} of size {size}: from "
                    f"{found.p[k]} along {d_out[k]} it meets t = {found.t[k]}, expected {expected}"
                )


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("kind", KINDS)
def test_no_self_intersection(kind: str, precision: str) -> None:
    check(kind, 12, 1000, precision)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_no_self_intersection_of_a_thousand_shapes(kind: str) -> None:
    check(kind, 1000, 1000, "single")
