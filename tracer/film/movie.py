"""Movies from pictures that are there already: MP4, WebM and GIF, by the ffmpeg that imageio-ffmpeg brings.

The same pictures give the same bytes on one version of ffmpeg: no date, no names of programs, a fixed number
of threads. Colors are those of sRGB with the matrix of ITU-R BT.709, which players expect.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import IO

from tracer.errors import MachineError, OutputError
from tracer.film.atomic import atomic_write

MOVIE_SUFFIXES = (".mp4", ".webm", ".gif")

_YUV = (
    *("-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2,scale=out_color_matrix=bt709:out_range=tv,format=yuv420p"),
    *("-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "iec61966-2-1"),
    *("-threads", "4"),
)
_ENCODERS: dict[str, tuple[str, ...]] = {
    ".mp4": (*_YUV, "-c:v", "libx264", "-preset", "faster", "-crf", "18", "-movflags", "+faststart"),
    ".webm": (
        *(*_YUV, "-c:v", "libvpx-vp9", "-b:v", "0", "-crf", "24"),
        *("-deadline", "good", "-cpu-used", "5", "-row-mt", "1", "-tile-columns", "2"),
    ),
    # A palette for each frame: one for all frames would hold all of them in memory first.
    ".gif": ("-vf", "split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1", "-loop", "0"),
}


def is_movie(file: str) -> bool:
    """Whether it has the name of a movie."""
    return Path(file).suffix.lower() in MOVIE_SUFFIXES


def find_ffmpeg() -> str:
    """The program; raises `MachineError` where there is none."""
    try:
        import imageio_ffmpeg

        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        raise MachineError(
            "movies need ffmpeg, which `pip install imageio-ffmpeg` brings for most systems; "
            "elsewhere IMAGEIO_FFMPEG_EXE names one"
        ) from None


def write_movie(path: str | os.PathLike[str], frames: Iterable[Path], rate: float) -> None:
    """Writes PNG pictures of one size as a movie of `rate` frames a second, whole or not at all.

    A movie with an odd number of rows or columns gets a black one more, except in a GIF. Raises OutputError.
    """
    suffix = Path(path).suffix.lower()
    command = [
        *(find_ffmpeg(), "-hide_banner", "-loglevel", "error", "-y"),
        *("-f", "image2pipe", "-c:v", "png", "-framerate", f"{rate:g}", "-i", "pipe:0"),
        *("-map_metadata", "-1", "-fflags", "+bitexact", "-flags:v", "+bitexact"),
        *_ENCODERS[suffix],
    ]
    with atomic_write(path) as temporary, tempfile.TemporaryFile() as talk:
        # In a session of its own, a Ctrl-C at the terminal reaches this process alone.
        with subprocess.Popen(
            [*command, "-f", suffix[1:], str(temporary)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=talk,
            start_new_session=True,
        ) as encoder:
            try:
                _feed(encoder, frames)
            except BaseException:
                encoder.kill()
                raise
        if encoder.returncode != 0 or not temporary.stat().st_size:
            reason = _last_line(talk) or _end_of(encoder.returncode)
            raise OutputError(f"{os.fspath(path)}: ffmpeg could not write it: {reason}")


def _feed(encoder: subprocess.Popen[bytes], frames: Iterable[Path]) -> None:
    assert encoder.stdin is not None
    try:
        for frame in frames:
            with frame.open("rb") as picture:
                shutil.copyfileobj(picture, encoder.stdin, 1 << 20)
        encoder.stdin.close()
    except BrokenPipeError:
        pass  # it gave up, and says why
    encoder.wait()


def _last_line(talk: IO[bytes]) -> str:
    talk.seek(0)
    lines = talk.read().decode(errors="replace").split("\n")
    return next((line.strip() for line in reversed(lines) if line.strip()), "")


def _end_of(code: int) -> str:
    """How a process ended that says nothing."""
    return (signal.strsignal(-code) if code < 0 else None) or "no reason given"
