"""The work file gives back what was kept, and nothing else, whatever happened to its end."""

from __future__ import annotations

import errno
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tracer.errors import OutputError, UsageError
from tracer.film.work_file import MAGIC, WorkFile

IDENTITY = {"supersample": 2, "camera.fov": 40.0, "crop": (0, 0, 8, 8)}
ARRAYS = {
    "color": np.arange(24, dtype=np.float32).reshape(2, 4, 3),
    "shape": np.array([[1, -1]], np.int32),
    "empty": np.zeros((0, 3)),
}


def kept(path: Path, count: int = 3) -> Path:
    """A work file with so many pieces."""
    work = WorkFile(path)
    work.start(IDENTITY)
    for k in range(count):
        work.keep({"piece": k}, {name: array + k for name, array in ARRAYS.items()})
    work.close()
    return path


def pieces(path: Path, identity: dict[str, Any] = IDENTITY) -> list[int]:
    """The numbers of the pieces that a file gives back, each of which must be right."""
    work = WorkFile(path, resume=True)
    work.start(identity)
    found = []
    for label, arrays in work.records():
        found.append(label["piece"])
        for name, array in ARRAYS.items():
            assert arrays[name].dtype == array.dtype
            assert np.array_equal(arrays[name], array + found[-1])
    work.close()
    return found


def test_what_was_kept_comes_back(tmp_path: Path) -> None:
    assert pieces(kept(tmp_path / "a.work")) == [0, 1, 2]
    work = WorkFile(tmp_path / "a.work", resume=True)
    work.start(IDENTITY)
    work.keep({"piece": 3}, {name: array + 3 for name, array in ARRAYS.items()})
    assert [label["piece"] for label, _ in work.records()] == [0, 1, 2, 3]
    work.close()
    assert pieces(tmp_path / "a.work") == [0, 1, 2, 3]
    work.remove()
    assert not list(tmp_path.iterdir())


def test_arrays_that_share_their_memory_are_written_once(tmp_path: Path) -> None:
    """Records of four numbers a pixel, one of them whole; a view of little of an array is copied."""
    pixels = np.arange(4 * 600, dtype=np.float32).reshape(20, 30, 4)
    arrays = {
        "color": pixels[..., :3],
        "shape": pixels[..., 3].view(np.int32),
        "band": np.arange(8000.0).reshape(80, 100)[8:16],
        "column": np.arange(8000.0).reshape(80, 100)[:, 1],
    }
    work = WorkFile(tmp_path / "a.work")
    work.start({})
    before = work.path.stat().st_size
    work.keep({"piece": 0}, arrays)
    assert work.path.stat().st_size - before < pixels.nbytes + (800 + 80) * 8 + 1000
    [(_, found)] = work.records()
    assert list(found) == list(arrays)
    for name, array in arrays.items():
        assert found[name].dtype == array.dtype
        assert found[name].tobytes() == array.tobytes()
    work.close()


@pytest.mark.parametrize("jobs", [("one", "two"), ("one", "another, longer"), ("some", "a")])
def test_what_an_earlier_job_left_in_the_file_does_not_come_back(
    tmp_path: Path, jobs: tuple[str, str]
) -> None:
    work = WorkFile(tmp_path / "a.work")
    work.start({"job": jobs[0]})
    for piece in range(3):
        work.keep({"piece": piece}, ARRAYS)
    work.restart({"job": jobs[1]})
    work.keep({"piece": 0}, ARRAYS)
    work.close()
    assert work.identity() == {"job": jobs[1]}
    assert pieces(tmp_path / "a.work", {"job": jobs[1]}) == [0]


def test_without_resume_it_begins_anew(tmp_path: Path) -> None:
    assert pieces(kept(kept(tmp_path / "a.work"), 1)) == [0]


def test_a_file_cut_anywhere_gives_its_whole_records(tmp_path: Path) -> None:
    whole = kept(tmp_path / "a.work").read_bytes()
    ends = [len(kept(tmp_path / "b.work", count).read_bytes()) for count in range(4)]
    for length in sorted({*range(0, len(whole), 7), *ends, *(end - 1 for end in ends)}):
        (tmp_path / "c.work").write_bytes(whole[:length])
        assert pieces(tmp_path / "c.work") == list(range(sum(end <= length for end in ends[1:])))


def test_a_changed_byte_ends_the_file_there(tmp_path: Path) -> None:
    whole = kept(tmp_path / "a.work").read_bytes()
    second = len(kept(tmp_path / "b.work", 1).read_bytes())
    for place in range(second, len(whole), 5):
        (tmp_path / "c.work").write_bytes(whole[:place] + bytes([whole[place] ^ 64]) + whole[place + 1 :])
        assert pieces(tmp_path / "c.work") in ([0], [0, 1])


def test_what_follows_a_torn_record_is_written_over_it(tmp_path: Path) -> None:
    file = kept(tmp_path / "a.work")
    file.write_bytes(file.read_bytes()[:-1])
    work = WorkFile(file, resume=True)
    work.start(IDENTITY)
    work.keep({"piece": 2}, {name: array + 2 for name, array in ARRAYS.items()})
    work.close()
    assert file.read_bytes() == kept(tmp_path / "b.work").read_bytes()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"supersample": 3}, "another `supersample`: 2, now 3"),
        ({"shapes.0.radius": 1.0}, "another `shapes.0.radius`: nothing, now 1.0"),
        ({"crop": (0, 0, 8, 9)}, r"another `crop`: \[0, 0, 8, 8\], now \[0, 0, 8, 9\]"),
    ],
)
def test_another_job_is_refused_by_name(tmp_path: Path, change: dict[str, Any], sentence: str) -> None:
    file = kept(tmp_path / "a.work")
    before = file.read_bytes()
    with pytest.raises(UsageError, match=f"a.work: was begun with {sentence}; without --resume"):
        pieces(file, IDENTITY | change)
    with pytest.raises(UsageError, match="another `camera.fov`: 40.0, now nothing"):
        pieces(file, {name: value for name, value in IDENTITY.items() if name != "camera.fov"})
    assert file.read_bytes() == before


def test_two_processes_do_not_write_into_one_file(tmp_path: Path) -> None:
    pytest.importorskip("fcntl")
    first = WorkFile(tmp_path / "a.work")
    first.start(IDENTITY)
    for resume in (False, True):
        with pytest.raises(UsageError, match="another tracer is at work on the same picture"):
            WorkFile(tmp_path / "a.work", resume).start(IDENTITY)
    first.close()
    assert pieces(tmp_path / "a.work") == []


def test_a_file_of_somebody_else_is_left_alone(tmp_path: Path) -> None:
    file = tmp_path / "a.work"
    file.write_text("my work")
    for action in (WorkFile(file).exists, lambda: WorkFile(file).start(IDENTITY)):
        with pytest.raises(OutputError, match="is in the way: it is no work file of tracer"):
            action()
    assert file.read_text() == "my work"
    for begin in (MAGIC[:5], MAGIC):  # a crash right at the start
        file.write_bytes(begin)
        assert WorkFile(file).exists()
        assert pieces(file) == []
        assert WorkFile(file).exists()
    assert not WorkFile(tmp_path / "b.work").exists()


def test_a_full_disk_costs_only_the_piece_that_did_not_fit(tmp_path: Path) -> None:
    work = WorkFile(kept(tmp_path / "a.work"), resume=True)
    work.start(IDENTITY)
    file: Any = work._file

    class FullDisk:
        """Takes ten bytes more."""

        room = 10

        def __getattr__(self, name: str) -> Any:
            return getattr(file, name)

        def write(self, data: memoryview) -> int:
            if not self.room:
                raise OSError(errno.ENOSPC, "No space left on device")
            written: int = file.write(data[: self.room])
            self.room -= written
            return written

    work._file = FullDisk()  # type: ignore[assignment]
    with pytest.raises(OutputError, match=r"a\.work: cannot be written: No space left on device"):
        work.keep({"piece": 3}, ARRAYS)
    assert (tmp_path / "a.work").read_bytes() == kept(tmp_path / "b.work").read_bytes()
    work.close()
