"""Each check of what spares shadow rays catches an error that is planted on purpose."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from tests.accuracy import test_shafts
from tests.accuracy.beams import check_lone, check_many_spheres, check_triangles, soup
from tests.accuracy.shafts import check_inside, check_spheres, random_balls, tangent_balls
from tracer import light_tables, suspects
from tracer.acceleration import beam
from tracer.backends import Backend
from tracer.shafts import Ball, Shaft, ball_around


def rewrite(patch: pytest.MonkeyPatch, owner: Any, name: str, old: str, new: str) -> None:
    """Replaces a function by itself with another text at one place."""
    function = inspect.unwrap(getattr(owner, name))
    source = textwrap.dedent(inspect.getsource(function))
    assert source.count(old) == 1, f"{name}: {source.count(old)} times {old!r}"
    place: dict[str, Any] = {}
    exec(source.replace(old, new), function.__globals__, place)
    patch.setattr(owner, name, place[name])


def narrow_blocker_covers(patch: pytest.MonkeyPatch) -> None:
    rewrite(patch, Shaft, "toward", "wider & (along", "(along")


def light_too_small(patch: pytest.MonkeyPatch) -> None:
    of = Shaft.of
    patch.setattr(
        Shaft,
        "of",
        staticmethod(lambda backend, p, ball: of(backend, p, Ball(ball.center, 0.99 * ball.radius))),
    )


def light_in_front_covered(patch: pytest.MonkeyPatch) -> None:
    rewrite(patch, Shaft, "toward", "inside_cone & beyond & apart", "inside_cone & apart")


def overlapping_counts_as_apart(patch: pytest.MonkeyPatch) -> None:
    rewrite(patch, Shaft, "toward", "apart = gap > 4 *", "apart = gap > -4e6 *")


def margin_of_lights_forgotten(patch: pytest.MonkeyPatch) -> None:
    rewrite(patch, Shaft, "toward", "4 * dr.fma(epsilon * CONTACT_REACH, size, self.slack)", "4 * slack")


def faces_not_turned(patch: pytest.MonkeyPatch) -> None:
    rewrite(patch, beam, "_meet", "dr.select(before, backend.Float(-1), 1)", "backend.Float(1)")


def faces_turned_by_noise(patch: pytest.MonkeyPatch) -> None:
    rewrite(patch, beam, "_meet", "dr.select(before,", "dr.select(dr.dot(faces[0], a) < 0,")


def slabs_for_a_ray(patch: pytest.MonkeyPatch) -> None:
    of = beam._Slabs.of

    def thin(backend: Backend, tables: Any, shaft: Shaft) -> Any:
        return of(backend, tables, replace(shaft, radius=shaft.radius * 0))

    patch.setattr(beam._Slabs, "of", staticmethod(thin))


def ball_of_the_light_too_small(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(light_tables, "ball_around", lambda points, e: ball_around(points, e) * [1, 1, 1, 0.99])


def spheres_check() -> None:
    for make in (random_balls, tangent_balls):
        check_spheres("single", make, 20_000, 4)


def inside_check() -> None:
    check_inside("single", 30_000, 2)


def sliver_check() -> None:
    check_lone("single", 80_000, 4)


def soup_check() -> None:
    check_triangles(soup, "single", 10_000, 1)


def many_check() -> None:
    check_many_spheres("single", 10_000, 1)


def own_sphere_forgotten(patch: pytest.MonkeyPatch) -> None:
    rewrite(
        patch, suspects, "_meet_sphere", "dr.select(own, inside, found.may_meet)", "~own & found.may_meet"
    )


def ball_check() -> None:
    test_shafts.test_a_light_lies_in_its_ball("ring", False)


@pytest.mark.parametrize(
    ("plant", "check"),
    [
        (narrow_blocker_covers, spheres_check),
        (light_too_small, spheres_check),
        (light_too_small, soup_check),
        (light_in_front_covered, spheres_check),
        (overlapping_counts_as_apart, inside_check),
        (margin_of_lights_forgotten, inside_check),
        (faces_not_turned, sliver_check),
        (faces_not_turned, soup_check),
        (faces_turned_by_noise, sliver_check),
        (slabs_for_a_ray, soup_check),
        (slabs_for_a_ray, many_check),
        (own_sphere_forgotten, many_check),
        (ball_of_the_light_too_small, ball_check),
    ],
)
def test_planted_error_is_caught(
    plant: Callable[[pytest.MonkeyPatch], None],
    check: Callable[[], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plant(monkeypatch)
    with pytest.raises((AssertionError, pytest.fail.Exception)):
        check()
