"""Which frames are asked for, and the names of their files."""

from __future__ import annotations

import re
import string
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tracer.errors import UsageError
from tracer.film.atomic import OUTPUT_SUFFIXES, check_writable, fill_template
from tracer.film.movie import MOVIE_SUFFIXES, find_ffmpeg, is_movie
from tracer.film.result import layer_file

LARGEST_FRAME = 10_000_000
FIELD = "{frame:04d}"


def read_frames(text: str) -> range:
    """The frames that `--frames` means: A, A:B or A:B:STEP, B included; raises `UsageError`."""
    if not re.fullmatch(r"\d{1,9}(:\d{1,9}){0,2}", text, re.ASCII):
        raise UsageError(
            f"--frames {text}: is no range; allowed: A, A:B or A:B:STEP with whole numbers, such as 1:120"
        )
    first, *rest = map(int, text.split(":"))
    last = rest[0] if rest else first
    step = rest[1] if len(rest) > 1 else 1
    if last < first or step < 1 or last > LARGEST_FRAME:
        raise UsageError(
            f"--frames {text}: is out of range; allowed: A:B:STEP with 0 <= A <= B <= {LARGEST_FRAME} "
            "and STEP at least 1"
        )
    return range(first, last + 1, step)


@dataclass(frozen=True)
class FrameFiles:
    """The files of an animation: templates of `pictures` that lack only the frame, `movies`, the `folder` of
    what is kept until the end, and which `layers` become pictures."""

    pictures: tuple[str, ...]
    movies: tuple[str, ...]
    folder: Path
    layers: tuple[str, ...] = ()

    def of(self, frame: int) -> list[Path]:
        """The files of one frame; the first PNG is the one that goes into movies."""
        files = [Path(template.format(frame=frame)) for template in self.pictures]
        if self.movies and not any(file.suffix.lower() == ".png" for file in files):
            files.append(self.folder / f"{frame:04d}.png")
        return files

    def layer_base(self, frame: int) -> Path:
        """The name beside which the pictures of a frame's layers stand; that of a movie gets a number."""
        if not self.pictures:
            return Path(self.movies[0]).with_suffix(f".{frame:04d}.png")
        return Path(self.pictures[0].format(frame=frame))

    def all_of(self, frame: int) -> list[Path]:
        """The files of one frame, those of its layers included."""
        return [*self.of(frame), *(layer_file(self.layer_base(frame), layer) for layer in self.layers)]

    def movie_frame(self, frame: int) -> Path:
        """The picture of a frame that goes into movies."""
        return next(file for file in self.of(frame) if file.suffix.lower() == ".png")


def frame_files(templates: Sequence[str], name: str, frames: range) -> FrameFiles:
    """The files for one scene; checks that they can be written and raises `UsageError`, `OutputError` or
    `MachineError`."""
    pictures, movies = [], []
    for template in templates:
        if is_movie(template):
            if has_field(template):
                raise UsageError(f'file name "{template}": a movie holds all frames; allowed: no {{frame}}')
            movies.append(fill_template(template, name))
            check_writable(movies[-1], MOVIE_SUFFIXES)
        else:
            numbered = template if has_field(template) else _with_field(template)
            check_writable(fill_template(numbered, name, frames[-1]), (*OUTPUT_SUFFIXES, *MOVIE_SUFFIXES))
            pictures.append(_filled(numbered, name))
    if movies:
        find_ffmpeg()
    return FrameFiles(tuple(pictures), tuple(movies), _folder(movies, pictures, name))


def has_field(template: str) -> bool:
    """Whether a template has a place for the frame."""
    try:
        return any(field == "frame" for _, field, _, _ in string.Formatter().parse(template))
    except ValueError:
        return False  # `fill_template` says what is wrong


def _with_field(template: str) -> str:
    """`out/a.png` as `out/a.{frame:04d}.png`."""
    suffix = Path(template).suffix
    return f"{template.removesuffix(suffix)}.{FIELD}{suffix}"


def _filled(template: str, name: str) -> str:
    """The template with the name in it and the places of the frame left open."""
    parts = []
    for text, field, form, _ in string.Formatter().parse(template):
        parts.append(text.replace("{", "{{").replace("}", "}}"))
        if field == "frame":
            parts.append(f"{{frame:{form}}}" if form else "{frame}")
        elif field is not None:
            filled = fill_template(f"{{{field}:{form}}}" if form else f"{{{field}}}", name)
            parts.append(filled.replace("{", "{{").replace("}", "}}"))
    return "".join(parts)


def _folder(movies: Sequence[str], pictures: Sequence[str], name: str) -> Path:
    """`out/a.frames` for `out/a.mp4`, and for `out/a.{frame:04d}.png` where there is no movie."""
    path = Path((*movies, *pictures)[0])
    parts = [path.stem] if movies else [text for text, *_ in string.Formatter().parse(path.stem)]
    return path.with_name(f"{''.join(parts).rstrip('.-_ ') or name}.frames")
