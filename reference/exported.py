"""Files for another renderer are written whole or not at all: what is named stands before what names it."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from tracer.errors import OutputError


class Exported(NamedTuple):
    """What was written: the `file`, the `pieces` beside it, and `remarks` on what has no counterpart."""

    file: Path
    pieces: list[Path]
    remarks: list[str]


@contextmanager
def beside(path: str | os.PathLike[str]) -> Iterator[tuple[Path, list[Path]]]:
    """Gives a file of PATH's name in a folder of its own, and a list that holds PATH and what was written
    beside it, pieces first, once the block has ended.

    Everything then moves to PATH's folder; whatever ends the block early leaves that as it was. OSError, the
    block's own included, becomes OutputError.
    """
    target = Path(os.path.realpath(path))
    written: list[Path] = []
    try:
        with tempfile.TemporaryDirectory(prefix=".tracer-", dir=target.parent) as folder:
            file = Path(folder) / target.name
            yield file, written
            pieces = sorted(piece for piece in Path(folder).iterdir() if piece != file)
            for piece in [*pieces, file]:
                os.replace(piece, target.with_name(piece.name))
                written.append(target.with_name(piece.name))
    except OSError as error:
        raise OutputError(f"{os.fspath(path)}: cannot be written: {error.strerror or error}") from error
