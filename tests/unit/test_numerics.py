"""What docs/numerics.md says of arithmetic, directions and cells; without the remedy it is not so."""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np
import pytest

import tracer
from tracer import arrival, ray
from tracer.backends import Backend, exact_arithmetic, find_backend
from tracer.ray import mirror_direction, normalize
from tracer.spawn import refract_direction
from tracer.textures.cells import CellRule

PRECISIONS = ("single", "double")
BOUNCES = 60


def vectors(backend: Backend, seed: int, n: int = 10_000) -> tuple[Any, np.ndarray]:
    """n vectors of lengths from 1e-3 to 1e3 in Dr.Jit, and the same numbers in extended precision."""
    rng = np.random.default_rng(seed)
    values = (rng.normal(size=(3, n)) * 10 ** rng.uniform(-3, 3, n)).astype(backend.dtype)
    return backend.Vector3(*(backend.Float(row) for row in values)), values.astype(np.longdouble)


@pytest.mark.parametrize("precision", PRECISIONS)
def test_infinity_times_zero_is_not_a_number(precision: str) -> None:
    backend = find_backend("llvm", precision)
    values = backend.Float([np.inf, 1, 2])
    with exact_arithmetic():
        assert np.isnan((values * 0).numpy()[0])
    with dr.scoped_set_flag(dr.JitFlag.FastMath, True):
        assert (values * 0).numpy()[0] == 0


@pytest.mark.parametrize("precision", PRECISIONS)
def test_division_and_square_root_are_correctly_rounded(precision: str) -> None:
    backend = find_backend("llvm", precision)
    values = np.random.default_rng(1).uniform(1, 4, 10_000).astype(backend.dtype)
    with exact_arithmetic():
        x = backend.Float(values)
        assert np.array_equal(dr.rcp(x).numpy(), 1 / values)
        assert np.array_equal(dr.sqrt(x).numpy(), np.sqrt(values))


@pytest.mark.parametrize("precision", PRECISIONS)
def test_normalize_errs_by_few_roundings(precision: str) -> None:
    """Three roundings in v.v count half, those of root, division and product once each: 4.5 eps."""
    backend = find_backend("llvm", precision)
    v, exact = vectors(backend, 2)
    exact = exact / np.sqrt((exact**2).sum(axis=0))
    with exact_arithmetic():
        found = normalize(v).numpy()
    assert np.abs(found / exact - 1).max() <= 4.5 * backend.epsilon


def length_error_after_bounces(backend: Backend) -> float:
    """How far |d| is from 1, in eps, after many reflections at random normals."""
    with exact_arithmetic():
        d = normalize(vectors(backend, 3, 1000)[0])
        for bounce in range(BOUNCES):
            d = mirror_direction(d, normalize(vectors(backend, 4 + bounce, 1000)[0]))
            dr.eval(d)
    length = np.sqrt((d.numpy().astype(np.longdouble) ** 2).sum(axis=0))
    return float(np.abs(length - 1).max() / backend.epsilon)


@pytest.mark.parametrize("precision", PRECISIONS)
def test_directions_stay_unit_from_bounce_to_bounce(precision: str, monkeypatch: pytest.MonkeyPatch) -> None:
    backend = find_backend("llvm", precision)
    assert length_error_after_bounces(backend) <= 4
    monkeypatch.setattr(ray, "unit_again", lambda d: d)
    assert length_error_after_bounces(backend) > 20


@pytest.mark.parametrize("ior", [1e-6, 1.5, 1e6])
@pytest.mark.parametrize("precision", PRECISIONS)
def test_refracted_directions_are_unit_for_any_index(precision: str, ior: float) -> None:
    """eta = 1e6 multiplies the rounding of d and c, so that the sum is no longer nearly unit."""
    backend = find_backend("llvm", precision)
    with exact_arithmetic():
        n = normalize(vectors(backend, 5)[0])
        aside = normalize(vectors(backend, 6)[0])
        d = normalize(dr.fma(backend.Float(1e-7), aside, -n))
        for entering in (True, False):
            bent, total = refract_direction(d, n, backend.Float(ior), backend.Bool(entering))
            length = np.sqrt((bent.numpy().astype(np.longdouble) ** 2).sum(axis=0))
            assert np.abs(length - 1)[~total.numpy()].max() <= 4 * backend.epsilon


def normals_of_a_smooth_cube(precision: str, size: float) -> np.ndarray:
    """(h, w, 3) shading normals of a cube of that size, seen from as many sizes away."""
    scene = tracer.load(
        {
            "camera": {
                "resolution": [16, 12],
                "origin": [3 * size, 2 * size, 4 * size],
                "target": [0, 0, 0],
                "fov": 40,
            },
            "shapes": [{"kind": "mesh", "builtin": "cube", "scale": size, "smooth": True}],
        }
    )
    return tracer.render(scene, precision=precision, aovs=("normal",)).aovs["normal"]


@pytest.mark.parametrize("size", [2.0**-50, 2.0**-33, 2.0**33, 2.0**50])
@pytest.mark.parametrize("precision", PRECISIONS)
def test_smooth_normals_do_not_depend_on_the_size(precision: str, size: float) -> None:
    """A power of two changes no rounding, as long as nothing leaves the range of the numbers."""
    found, wanted = (normals_of_a_smooth_cube(precision, each) for each in (size, 1.0))
    assert np.array_equal(found, wanted, equal_nan=True)


def colors_on_a_border(precision: str) -> set[float]:
    """The colors of a tilted plane that lies exactly on the border of two stripes."""
    scene = tracer.load(
        {
            "ambient": 1.0,
            "camera": {"resolution": [64, 48], "origin": [1.1, 3.0, 5.2], "target": [0, 0.3, 0], "fov": 40.0},
            "textures": {"bands": {"kind": "stripes", "colors": ["#ffffff", "#000000"], "interval": 0.1}},
            "shapes": [{"kind": "plane", "coefficients": [1, 1, 1, -0.3], "texture": "bands"}],
        }
    )
    return set(tracer.render(scene, precision=precision).color.ravel().tolist())


@pytest.mark.parametrize("precision", PRECISIONS)
def test_a_plane_on_the_border_of_cells_has_one_color(
    precision: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert colors_on_a_border(precision) == {0.0}
    monkeypatch.setattr(CellRule, "cell", lambda rule, q, largest: dr.floor(q))
    assert colors_on_a_border(precision) == {0.0, 1.0}


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("exponent", [0.0, 1.0, 250.0, 1e4])
def test_highlights_vanish_where_they_leave_the_range(exponent: float, precision: str) -> None:
    """Where x^s is about 2^-1024 an exponential of Dr.Jit in double precision is -inf."""
    backend = find_backend("llvm", precision)
    small = 2 ** np.linspace(-5, 0, 100_001)
    base = np.concatenate([[0.0, 1e-30, 1.0], np.linspace(0.0, 1.0, 100_001), small]).astype(backend.dtype)
    with exact_arithmetic():
        found = arrival._power(backend.Float(base), backend.Float(exponent), backend.Bool(base >= 0))
        found = found.numpy()
    exact = base.astype(np.float64) ** exponent
    assert np.isfinite(found).all()
    # The exponent s log2(x) is rounded twice, and counts with its size; below 1e-37 a highlight is none.
    size = 1 + exponent * np.abs(np.log2(np.maximum(base.astype(np.float64), 1e-300)))
    assert (np.abs(found - exact) <= 8 * backend.epsilon * exact * size + 1e-37).all()
