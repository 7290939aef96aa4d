"""Files are written whole or not at all: a temporary file in the same folder, then one rename."""

from __future__ import annotations

import os
import secrets
import string
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tracer.errors import OutputError, UsageError

OUTPUT_SUFFIXES = (".png", ".exr", ".npz")


@contextmanager
def atomic_write(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Gives the path of an empty temporary file beside `path`, which becomes `path` when the block ends.

    Whatever ends the block early (Ctrl-C too) removes the temporary file and leaves `path` as it was. The
    file has the permissions of any new file (umask). A link is followed: the file it points to is replaced.
    OSError, the block's own included, becomes OutputError.
    """
    target = Path(os.path.realpath(path))
    temporary = target.with_name(f".tracer-{secrets.token_hex(8)}{target.suffix}")
    try:
        _create(temporary)
        yield temporary
        os.replace(temporary, target)
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"{os.fspath(path)}: cannot be written: {error.strerror or error}") from error
    finally:
        _remove(temporary)


def check_writable(path: str | os.PathLike[str], suffixes: Collection[str] = OUTPUT_SUFFIXES) -> None:
    """Refuses a file that could not be written later; to be called before a long render starts.

    A file is really created in the folder and removed again: the permission bits say nothing to root, and
    nothing about read-only media. Raises OutputError.
    """
    shown, suffix, folder = os.fspath(path), Path(path).suffix, Path(path).parent
    if not shown:
        raise OutputError('"": is no file name')
    target = Path(os.path.realpath(path))
    if os.path.isdir(target):
        raise OutputError(f"{shown}: is a folder, not a file name")
    if suffix.lower() not in suffixes:
        found = f'the extension "{suffix}" is unknown' if suffix else "has no extension"
        raise OutputError(f"{shown}: {found}; allowed: {', '.join(suffixes)}")
    if not target.parent.exists():
        raise OutputError(f"{shown}: the folder {folder} does not exist")
    if not target.parent.is_dir():
        raise OutputError(f"{shown}: {folder} is not a folder")
    probe = target.with_name(f".tracer-{secrets.token_hex(8)}")
    try:
        with suppress(FileNotFoundError):
            target.lstat()  # fails for a name that is too long
        _create(probe)
    except OSError as error:
        raise OutputError(f"{shown}: cannot be written: {error.strerror} (folder {folder})") from error
    finally:
        _remove(probe)


def fill_template(template: str, name: str, frame: int | None = None) -> str:
    """The file name with `{name}` and `{frame}` (also `{frame:04d}`) filled in; `{{` stands for a brace.

    Separators in `name` become `_`, so that a scene's name never chooses the folder. Raises UsageError.
    """
    values: dict[str, object] = {"name": name.replace("/", "_").replace("\\", "_")}
    if frame is not None:
        values["frame"] = frame
    try:
        fields = [field for _, field, _, _ in string.Formatter().parse(template) if field is not None]
    except ValueError as error:
        raise UsageError(f'file name "{template}": {error}; write {{{{ for a brace') from error
    for field in fields:
        if field == "frame" and frame is None:
            raise UsageError(f'file name "{template}": {{frame}} has no value where there is only one frame')
        if field not in values:
            raise UsageError(
                f'file name "{template}": unknown field {{{field}}}; allowed: {{name}}, {{frame:04d}}'
            )
    try:
        return template.format(**values)
    except (ValueError, KeyError, IndexError) as error:
        raise UsageError(f'file name "{template}": bad format of a field: {error}') from error


def _create(path: Path) -> None:
    os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))


def _remove(path: Path) -> None:
    with suppress(OSError):  # mostly it is gone already; no failure here may hide the one that led here
        path.unlink()
