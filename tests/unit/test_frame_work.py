"""Work files of frames: what was kept is found again, and files are used again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tracer.errors import OutputError
from tracer.film.frame_work import FrameWork

PIXELS = {"color": np.ones((4, 4, 3), np.float32)}


def names(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir())


def left_behind(folder: Path) -> None:
    """As a crash leaves it: frame 3 is in its files, 4 and 5 are under way, the latter without a band."""
    kept = FrameWork(folder, {"scene": 1}, range(3, 9))
    for frame in (3, 4):
        kept.of(frame).keep({"band": frame}, PIXELS)
    kept.release(3)
    kept.of(5)
    assert names(folder) == ["1.work", "2.work"], "that of frame 3 was used again"
    for work in kept._under_way.values():
        work.close()


def test_a_frame_under_way_is_found_again(tmp_path: Path) -> None:
    left_behind(tmp_path)
    with FrameWork(tmp_path, {"scene": 1}, range(4, 9)) as kept:
        work = kept.of(4)
        assert work.resume and [label for label, _ in work.records()] == [{"band": 4}]
        assert kept.of(5).labels == []
        kept.release(4)
        assert kept.of(6).labels == []
        assert names(tmp_path) == ["1.work", "2.work"]
        for frame in (5, 6):
            kept.release(frame)
    assert names(tmp_path) == []


@pytest.mark.parametrize(("made_of", "missing"), [({"scene": 2}, range(4, 9)), ({"scene": 1}, range(6, 9))])
def test_what_is_of_no_use_is_written_over(made_of: dict[str, int], missing: range, tmp_path: Path) -> None:
    """Work on another scene, and that on frames which are in their files."""
    left_behind(tmp_path)
    with FrameWork(tmp_path, made_of, missing) as kept:
        assert [kept.of(frame).labels for frame in (6, 7)] == [[], []]
        assert names(tmp_path) == ["1.work", "2.work"]
    assert names(tmp_path) == ["1.work", "2.work"], "they are still under way"


def test_a_file_of_somebody_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine.work").write_text("mine")
    (tmp_path / "7.work").write_text("my work")
    with pytest.raises(OutputError, match="7.work: is in the way: it is no work file of tracer"):
        FrameWork(tmp_path, {}, range(1))
    (tmp_path / "7.work").unlink()
    with FrameWork(tmp_path, {}, range(1)) as kept:
        kept.of(0)
        kept.release(0)
    assert names(tmp_path) == ["mine.work"]
