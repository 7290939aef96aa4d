"""Replayed kernels: the same answers, and a recording of its own for everything that is structure."""

from __future__ import annotations

import importlib
import os
import sys
from dataclasses import dataclass, field
from typing import Any

import drjit as dr
import numpy as np
import pytest

import tracer
from tests.accuracy import worlds
from tracer.backends import Backend, find_backend
from tracer.replay import NOT_IN_KERNELS, Program, put_together, take_apart


@dataclass
class Numbers:
    """What the program below works on."""

    backend: Backend
    values: Any
    offsets: list[Any]
    steps: tuple[int, ...]
    notes: Any = field(metadata=NOT_IN_KERNELS, default=None)


class Counted:
    """A program, and how often its function ran."""

    def __init__(self) -> None:
        self.runs = 0
        self.program = Program(self._sum)

    def _sum(self, numbers: Numbers, name: str) -> dict[str, Any]:
        self.runs += 1
        assert numbers.notes is None
        total = numbers.values * 1
        for step, offset in zip(numbers.steps, numbers.offsets, strict=True):
            total = total + step * offset.x - offset.y
        return {name: total}

    def __call__(self, numbers: Numbers, name: str = "sum") -> list[float]:
        result: list[float] = self.program(numbers, name)[name].numpy().tolist()
        return result


def numbers(
    values: list[float],
    offsets: list[float],
    steps: tuple[int, ...],
    precision: str = "single",
    notes: Any = 0,
) -> Numbers:
    backend = find_backend("llvm", precision)
    vectors = [backend.Vector2(backend.opaque(x), backend.opaque(10 * x)) for x in offsets]
    return Numbers(backend, backend.Float(np.array(values, backend.dtype)), vectors, steps, notes)


def expected(values: list[float], offsets: list[float], steps: tuple[int, ...]) -> list[float]:
    return [v + sum(s * x - 10 * x for s, x in zip(steps, offsets, strict=True)) for v in values]


def test_arrays_change_without_a_new_run() -> None:
    counted = Counted()
    for values, offsets in (([1, 2, 3], [4, 5]), ([7, 0, 2], [4, 5]), ([1, 2, 3], [-1, 8])):
        found = counted(numbers(values, offsets, (2, 3), notes=object()))
        assert found == expected(values, offsets, (2, 3))
    assert counted.runs == 1


CHANGES: dict[str, dict[str, Any]] = {
    "a length": {"values": [1, 2, 3, 4]},
    "a length of one": {"values": [1]},
    "how many": {"offsets": [4], "steps": (2,)},
    "a constant": {"steps": (2, 2)},
    "a constant for another that occurs": {"steps": (3, 3)},
    "the precision": {"precision": "double"},
}


@pytest.mark.parametrize("change", CHANGES)
def test_structure_is_a_recording_of_its_own(change: str) -> None:
    counted = Counted()
    given: dict[str, Any] = {"values": [1, 2, 3], "offsets": [4, 5], "steps": (2, 3)}
    for table in (given, given | CHANGES[change], given, given | CHANGES[change]):
        found = counted(numbers(**table))
        table.pop("precision", None)
        assert found == expected(**table)
    assert counted.runs == 2


def test_a_name_and_the_threads_are_structure() -> None:
    counted, given = Counted(), numbers([1, 2], [3], (4,))
    counted(given, "a")
    counted(given, "b")
    assert counted.runs == 2
    dr.set_thread_count(1 if dr.thread_count() != 1 else 2)
    counted(given, "b")
    assert counted.runs == 3


def test_which_arrays_are_the_same_is_structure() -> None:
    """Dr.Jit alone would read the third array where the first one is."""
    backend = find_backend("llvm", "single")
    one, two = backend.opaque(1.0), backend.opaque(2.0)
    program = Program(lambda a, b, c: {"sum": a + 10 * b + 100 * c})
    for _ in range(2):
        for chosen, expected in ((one, 121), (two, 221)):
            assert program(one, two, chosen)["sum"].numpy().tolist() == [expected]


def test_forgotten_recordings_are_made_again() -> None:
    counted, given = Counted(), numbers([1, 2], [3], (4,))
    counted(given)
    counted.program.forget()
    counted(given)
    assert counted.runs == 2


@pytest.mark.parametrize("failure", [ValueError("of the function"), KeyboardInterrupt()])
@pytest.mark.parametrize("where", ["in the function", "in a loop"])
def test_what_the_function_raises_comes_through(failure: BaseException, where: str) -> None:
    """As it is, and the next call records as if nothing had been."""
    backend = find_backend("llvm", "single")
    fails = True

    def function(values: Any) -> dict[str, Any]:
        def body(i: Any) -> tuple[Any]:
            if fails:
                raise failure
            return (i + 1,)

        if where == "in the function":
            return {"i": body(values)[0]}
        return {"i": dr.while_loop((values * 1,), lambda i: i < 5, body)[0]}

    program, values = Program(function), backend.UInt32([0, 1, 2])
    with pytest.raises(type(failure)) as caught:
        program(values)
    assert caught.value is failure
    fails = False
    for _ in range(2):
        found = program(values)["i"].numpy().tolist()
        assert found == ([1, 2, 3] if where == "in the function" else [5, 5, 5])


def test_a_tree_comes_back_as_it_was() -> None:
    given = numbers([1, 2, 3], [4, 5], (6, 7), notes="left out")
    arrays: list[Any] = []
    structure = take_apart([given, (given.values, "x")], arrays)
    assert len(arrays) == 1 + 2 * 2 + 1 and hash(structure) is not None
    (found, (values, name)) = put_together(structure, iter(arrays))
    assert isinstance(found, Numbers) and found.notes is None
    assert found.backend == given.backend and found.steps == (6, 7) and name == "x"
    assert values.numpy().tolist() == [1, 2, 3]
    assert found.offsets[1].y.numpy().tolist() == [50]


# ---- Frames ------------------------------------------------------------------------------------------------


def test_a_frame_is_traced_in_python_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A moved camera and other numbers replay, with the same bytes as traced anew; another size does not."""
    module = importlib.import_module("tracer.launch")
    true, traced = module.trace_pixels, list[int]()
    monkeypatch.setattr(module, "trace_pixels", lambda *arguments: traced.append(1) or true(*arguments))
    scene = tracer.load(worlds.room())

    def frame(*size: int) -> bytes:
        return tracer.render(scene, backend="llvm", resolution=size).color.tobytes()

    pictures = [frame(40, 30)]
    scene.camera.rotate = (3.0, -4.0)
    pictures.append(frame(40, 30))
    scene.shapes[3] = scene.shapes[3].model_copy(update={"center": (0.5, 1.3, 1.0)})
    pictures.append(frame(40, 30))
    assert len(traced) == 1 and len(set(pictures)) == 3
    module.trace_lanes.forget()
    assert frame(40, 30) == pictures[2] and len(traced) == 2
    frame(48, 30)
    assert len(traced) == 3


def resident() -> int:
    """Bytes of this process in memory."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGESIZE")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")
def test_thousands_of_frames_take_no_more_memory() -> None:
    """With a mesh that moves, so that the hierarchy is built for every frame."""
    scene = tracer.load(worlds.room())

    def frames(count: int) -> None:
        for number in range(count):
            scene.camera.rotate = (number % 50 / 10, 0.0)
            scene.shapes[5] = scene.shapes[5].model_copy(update={"translate": (3.5, number % 7 / 10, -2.5)})
            size = (16 + 8 * (number // 50 % 3), 16)
            tracer.render(scene, backend="llvm", resolution=size)

    frames(300)
    before = resident()
    frames(2000)
    assert resident() - before < 4 << 20
