"""Each check of the suite catches an error that is planted on purpose."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np
import pytest

import tracer
from tests.accuracy import test_against_plain, test_creases, test_exact_optics, test_self_hits, worlds
from tracer import spawn, surface, whitted
from tracer.acceleration import traverse
from tracer.ray import Ray
from tracer.shapes.sphere import SphereSlot

Plant = Callable[[pytest.MonkeyPatch], None]


def flipped_normal(patch: pytest.MonkeyPatch) -> None:
    true = SphereSlot.surface
    patch.setitem(surface.ANALYTIC_SURFACES, 1, lambda row, p: (true(row, p)[0], -true(row, p)[1]))


def inverted_eta(patch: pytest.MonkeyPatch) -> None:
    true = spawn.refract_direction
    patch.setattr(spawn, "refract_direction", lambda d, n, ior, entering: true(d, n, dr.rcp(ior), entering))


def mirror_through(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(surface, "mirror_direction", lambda d, n: dr.fma(-1.999999 * dr.dot(n, d), n, d))


def unnormalized_weights(patch: pytest.MonkeyPatch) -> None:
    from tracer import light_tables

    patch.setattr(light_tables.math, "fsum", lambda weights: 1.0)


def depth_from_the_eye(patch: pytest.MonkeyPatch) -> None:
    true = whitted.primary_ray

    def from_the_eye(backend: Any, canvas: Any, pixels: Any, sub_ray: Any) -> tuple[Any, Any]:
        o, d = true(backend, canvas, pixels, sub_ray)
        return o - 0.5 * d, d

    patch.setattr(whitted, "primary_ray", from_the_eye)


def no_departure(patch: pytest.MonkeyPatch) -> None:
    """The ray forgets what it leaves."""
    patch.setattr(Ray, "leaves", lambda ray, primitive: dr.full(dr.mask_t(ray.o.x), False, dr.width(ray.o)))
    patch.setattr(Ray, "departing", property(lambda ray: dr.full(dr.mask_t(ray.d.x), False, dr.width(ray.d))))


def nothing_doubtful(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(traverse, "doubtful", lambda departure, test: departure.active & False)


def room_picture(tmp_path: Path) -> None:
    test_against_plain.compare_double(
        test_against_plain.small(worlds.FEATURES["room"]()), worlds.write_files(tmp_path)
    )


def white(tmp_path: Path) -> None:
    test_exact_optics.test_white_never_exceeds_one("double", 0)


def sphere_again(tmp_path: Path) -> None:
    test_self_hits.check("sphere", 3, 1000, "single")


def triangle_again(tmp_path: Path) -> None:
    test_self_hits.check("triangle", 3, 1000, "single")


def flat_edge(tmp_path: Path) -> None:
    test_creases.check(180, trials=1, rays=5000, offset=3)


def crease(tmp_path: Path) -> None:
    test_creases.check(90, trials=1, rays=5000, offset=3)


@pytest.mark.parametrize(
    ("plant", "check"),
    [
        (flipped_normal, room_picture),
        (inverted_eta, room_picture),
        (mirror_through, room_picture),
        (unnormalized_weights, room_picture),
        (unnormalized_weights, white),
        (depth_from_the_eye, room_picture),
        (no_departure, sphere_again),
        (no_departure, triangle_again),
        (nothing_doubtful, flat_edge),
        (nothing_doubtful, crease),
    ],
)
def test_planted_error_is_caught(
    plant: Plant, check: Callable[[Path], None], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    plant(monkeypatch)
    with pytest.raises((AssertionError, pytest.fail.Exception)):
        check(tmp_path)


def test_the_checks_pass_without_a_planted_error(tmp_path: Path) -> None:
    for check in (room_picture, white, sphere_again, triangle_again, flat_edge, crease):
        check(tmp_path)
    assert np.isfinite(tracer.render(tracer.load(worlds.room())).color).all()
