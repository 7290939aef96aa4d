"""Records of the numbers of a pixel: what stands together, written by lanes and taken apart again."""

from __future__ import annotations

import itertools
from typing import Any

import drjit as dr
import numpy as np
import pytest

import tracer
from tests.accuracy import worlds
from tracer.aovs import NAMES
from tracer.backends import find_backend
from tracer.film.layout import INTEGERS
from tracer.pixel_records import (
    PLAIN,
    components_of,
    key_of,
    line_of,
    records_of,
    scattered,
    taken_apart,
    width_of,
)


def test_vectors_take_numbers_along() -> None:
    assert records_of(PLAIN, True) == records_of(PLAIN, False) == [("color", "alpha"), ("depth", "z")]
    counts = components_of(["normal", "shape", "level"], 1)
    assert records_of(counts, True) == [("color", "normal", "alpha", "depth"), ("level", "shape", "z")]
    assert records_of(counts, False) == [("color", "normal", "alpha", "depth"), ("z",), ("level", "shape")]
    everything = components_of(NAMES, 3)
    assert [width_of(record, everything, True) for record in records_of(everything, True)] == [16, 16, 8]


@pytest.mark.parametrize("lights", [1, 3, 4, 5, 9, 17, 40])
def test_nothing_is_lost_and_little_is_filled_up(lights: int) -> None:
    for number, mixed in itertools.product((0, 1, 3, len(NAMES)), (True, False)):
        counts = components_of(NAMES[:number], lights)
        records, line = records_of(counts, mixed), line_of(mixed)
        assert sorted(itertools.chain(*records)) == sorted(counts)
        widths = [width_of(record, counts, mixed) for record in records]
        assert all(width in (1, 2, 4, 8) or width % line == 0 for width in widths)
        assert sum(widths) <= 1.34 * sum(counts.values())
        if not mixed:
            assert all(len({name in INTEGERS for name in record}) == 1 for record in records)


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("lights", [1, 5, 20])
def test_lanes_write_what_is_read(precision: str, lights: int) -> None:
    backend, pixels = find_backend("llvm", precision), 37
    counts = components_of(NAMES, lights)
    rng = np.random.default_rng(3)
    expected: dict[str, Any] = {}
    for name, count in counts.items():
        whole = rng.integers(-1, 2**31 - 1, (pixels, count), dtype=np.int64)
        expected[name] = (
            whole.astype(INTEGERS[name]) if name in INTEGERS else rng.normal(size=(pixels, count))
        )
        if name not in INTEGERS:
            expected[name] = expected[name].astype(backend.dtype)
    order = rng.permutation(pixels + 3)  # three lanes own no pixel
    lanes = np.minimum(order, pixels - 1)
    types = {np.int32: backend.Int32, np.uint32: backend.UInt32}
    values = {
        name: [types.get(INTEGERS.get(name), backend.Float)(column[lanes]) for column in array.T]
        for name, array in expected.items()
    }
    written = scattered(
        backend, values, backend.UInt32(order.astype(np.uint32)), backend.Bool(order < pixels), pixels
    )
    dr.eval(written)
    mixed = precision == "single"
    assert set(written) == {key_of(record) for record in records_of(counts, mixed)}
    found = taken_apart({key: array.numpy() for key, array in written.items()}, counts, mixed)
    for name, array in expected.items():
        assert found[name].dtype == array.dtype and np.array_equal(found[name], array), name


def test_the_plain_kernel_carries_nothing_for_layers() -> None:
    """Variables of the loop, counted in what Dr.Jit hands to LLVM: for the layers of the first hit there are
    its primitive and its sub-ray, for those of counts nothing."""

    def carried(*layers: str) -> int:
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            tracer.render(tracer.load(worlds.room()), aovs=layers, backend="llvm")
            kernels = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
        text = max((kernel["ir"].read() for kernel in kernels), key=len)
        loop = text.partition("; Symbolic loop: whitted")[2].splitlines()[1:]
        return len(list(itertools.takewhile(lambda line: " = phi " in line, loop)))

    plain = carried()
    assert plain > 20
    assert carried("level", "rays") == plain
    assert carried("shape") == plain + 1
    assert carried("normal", "position", "uv") == plain + 2
    assert carried("ambient") == plain + 3
