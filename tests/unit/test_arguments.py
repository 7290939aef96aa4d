"""Arguments of the public functions that make no sense: one sentence that names the argument."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

import tracer
from tracer.errors import UsageError

BALL: dict[str, Any] = {
    "camera": {"resolution": [8, 6], "distance": 80.0},
    "shapes": [{"kind": "sphere", "center": [0, 0, -30], "radius": 10}],
}
RAY = ([[0.0, 0.0, 50.0]], [[0.0, 0.0, -1.0]])
QUERIES = {
    "intersect": tracer.intersect,
    "visible": tracer.visible,
    "trace_path": lambda scene, a, b, **more: tracer.trace_path(scene, a, b, events="RT", **more),
}


@pytest.mark.parametrize("given", ["room", None, BALL], ids=["name", "nothing", "dict"])
def test_a_scene_has_to_be_loaded(given: Any) -> None:
    message = "^scene: .* is no Scene; allowed: what tracer.load returns$"
    for call in (tracer.render, lambda scene: tracer.pixel_tree(scene, 1, 1)):
        with pytest.raises(UsageError, match=message):
            call(given)
    for query in QUERIES.values():
        with pytest.raises(UsageError, match=message):
            query(given, *RAY)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"scale": "a"}, "^scale: a is out of range; allowed is a number above 0$"),
        ({"scale": None}, "^scale: None is out of range"),
        ({"threads": 1.5}, "^threads: 1.5 is out of range; allowed is a whole number, 1 or more$"),
        ({"threads": "2"}, "^threads: 2 is out of range"),
        ({"memory": "2G"}, "^memory: 2G is out of range"),
        ({"memory": 0}, "^memory: 0 is out of range"),
        ({"rays_per_band": 0}, "^rays_per_band: 0 is out of range"),
        (
            {"resolution": (3.5, 2)},
            r"^resolution: \(3.5, 2\) is out of range; allowed are 2 whole numbers, 1 or more$",
        ),
        ({"resolution": (3,)}, r"^resolution: \(3,\) is out of range"),
        ({"resolution": 3}, "^resolution: 3 is out of range"),
        ({"crop": (0, 0, 1)}, r"^crop: \(0, 0, 1\) is out of range; allowed are 4 whole numbers$"),
        ({"crop": (0.5, 0, 3, 3)}, "^crop: .* is out of range"),
        ({"aovs": 3}, "^aovs: 3 is no list of names$"),
        ({"aovs": None}, "^aovs: None is no list of names$"),
        ({"supersample": "adaptive", "threshold": "x"}, "^threshold: x is out of range; allowed is 0 to 1$"),
    ],
)
def test_settings_of_a_render(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        tracer.render(tracer.load(BALL), **settings)


def test_settings_may_be_numpy_numbers() -> None:
    settings: dict[str, Any] = {
        "resolution": np.array([4, 3]),
        "crop": tuple(np.arange(4)),
        "scale": np.float32(1),
    }
    assert tracer.render(tracer.load(BALL), **settings).color.shape == (2, 2, 3)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([["a", "b", "c"]], "these are no numbers; allowed is an array"),
        ([[1j, 0, 0]], "these are no numbers; allowed is an array"),
        ([[0, 0], [0, 0, 1]], "these are no numbers; allowed is an array"),
        (None, r"the shape is \(\); allowed is \(n, 3\)"),
        ([[0, 0]], r"the shape is \(1, 2\); allowed is \(n, 3\)"),
        ([[0, 0, np.nan]], "row 0 is .*; allowed are finite numbers"),
        ([[0, 0, 1], [0, np.inf, 0]], "row 1 is .*; allowed are finite numbers"),
    ],
)
@pytest.mark.parametrize("query", QUERIES)
def test_points_and_directions(query: str, values: Any, message: str) -> None:
    first, second = ("points", "targets") if query == "visible" else ("origins", "directions")
    scene = tracer.load(BALL)
    with pytest.raises(UsageError, match=f"^{first}: {message}"):
        QUERIES[query](scene, values, RAY[1])
    with pytest.raises(UsageError, match=f"^{second}: {message}"):
        QUERIES[query](scene, RAY[0], values)


@pytest.mark.parametrize("query", QUERIES)
def test_as_many_points_as_directions(query: str) -> None:
    names = "points and targets" if query == "visible" else "origins and directions"
    with pytest.raises(UsageError, match=f"^{names}: 3 and 2 rows; allowed is one number$"):
        QUERIES[query](tracer.load(BALL), np.zeros((3, 3)), np.ones((2, 3)))


@pytest.mark.parametrize("query", QUERIES)
def test_points_beyond_the_range_of_the_precision(query: str) -> None:
    """Squares of distances between points have to stay in the range of the numbers."""
    scene = tracer.load(BALL)
    for far, precision in ((1e19, "single"), (1e300, "single"), (1e154, "double")):
        with pytest.raises(UsageError, match=r"row 0 is .*; allowed in \w+ precision are coordinates up to "):
            QUERIES[query](scene, [[0, 0, far]], RAY[1], precision=precision)


@pytest.mark.parametrize("length", [1e-300, 1e-40, 1e-20, 1e20, 1e40, 1e300])
@pytest.mark.parametrize("precision", ["single", "double"])
def test_directions_of_any_length(length: float, precision: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = tracer.intersect(tracer.load(BALL), RAY[0], np.array(RAY[1]) * length, precision=precision)
    assert found.t.tolist() == [70.0]


@pytest.mark.parametrize("length", [0.0, 5e-324], ids=["zero", "subnormal"])
def test_directions_without_length(length: float) -> None:
    with pytest.raises(UsageError, match="^directions: row 1 is zero; allowed is a direction$"):
        tracer.intersect(tracer.load(BALL), [[0, 0, 50]] * 2, [[0, 0, -1], [0, 0, length]])


@pytest.mark.parametrize("events", [3, None, [1], [["R"], 2]])
def test_events_are_strings(events: Any) -> None:
    with pytest.raises(UsageError, match="^events: .* is no string; allowed are the letters R and T$"):
        tracer.trace_path(tracer.load(BALL), *RAY, events=events)


@pytest.mark.parametrize("precision", ["single", "double"])
def test_no_rays_give_arrays_of_the_same_types(precision: str) -> None:
    scene, none = tracer.load(BALL), np.zeros((0, 3))
    some, nothing = (tracer.intersect(scene, *rays, precision=precision) for rays in (RAY, (none, none)))
    for name, array in vars(some).items():
        assert getattr(nothing, name).dtype == array.dtype, name
        assert getattr(nothing, name).shape == (0, *array.shape[1:]), name
