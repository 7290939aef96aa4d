"""One animation on its way from the scene to the files."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import click

from tracer.cli.animation_job import Course, Job
from tracer.cli.animation_statistics import AnimationStatistics, format_animation
from tracer.cli.failures import talk
from tracer.cli.frame_writer import FrameWriter
from tracer.cli.interruption import Interruption
from tracer.cli.layers import told_layers
from tracer.cli.progress import FramesProgress, make_reporter
from tracer.cli.statistics import save_statistics
from tracer.cli.wishes import Wishes, warn
from tracer.errors import OutputError, TracerError
from tracer.film.counts import counts_in
from tracer.film.frame_record import FrameRecord
from tracer.film.frame_work import FrameWork
from tracer.film.movie import write_movie
from tracer.film.result import Result
from tracer.film.work_file import WorkFile
from tracer.kept_bands import seconds_in
from tracer.llvm import ensure_llvm
from tracer.render import RenderInterrupted, render, scene_hash
from tracer.scene.files import file_digests
from tracer.scene_warnings import warnings_of
from tracer.version import __version__


class AnimationRun:
    """Renders what is not finished of one animation."""

    def __init__(
        self, job: Job, wishes: Wishes, course: Course, backend: str, interruption: Interruption
    ) -> None:
        self._job, self._wishes, self._course, self._interruption = job, wishes, course, interruption
        self._record = FrameRecord(job.files.folder, _made_of(job, wishes, backend))
        self._statistics = AnimationStatistics()

    def make(self) -> int:
        """Renders what is not finished, and the movies; returns the exit code."""
        for warning in warnings_of(self._job.scene):
            warn(warning, self._wishes)
        self._record.start(self._wishes.resume)
        try:
            return self._make()
        except OutputError as error:
            finished = f"{self._record.finished} of {len(self._course.frames)} frames"
            raise OutputError(f"{error}; {finished} are finished, --resume goes on") from error
        except TracerError:
            if not self._wishes.resume and not self._record.finished:
                self._record.remove()  # nothing to go on with
            raise

    def _make(self) -> int:
        frames, files = self._course.frames, self._job.files
        missing = [frame for frame in frames if not self._record.is_done(frame, files.all_of(frame))]
        for frame in set(frames).difference(missing):
            self._statistics.add_counts(self._record.counts(frame))
        finished = self._render(missing) + len(frames) - len(missing)
        if finished < len(frames):
            return self._stop(f"{finished} of {len(frames)} frames of {self._job.source} are finished")
        try:
            with self._statistics.phase("movies"):
                for movie in files.movies:
                    write_movie(movie, map(files.movie_frame, frames), self._course.rate)
        except KeyboardInterrupt:
            return self._stop(
                f"all {len(frames)} frames of {self._job.source} are finished, its movie is not"
            )
        self._record.remove()
        self._tell(len(missing))
        return 0

    def _render(self, missing: Sequence[int]) -> int:
        """Renders frames, until the user wants to stop; returns how many are in their files."""
        reporter = make_reporter(self._wishes.reporter, self._job.scene.name)
        progress = FramesProgress(reporter, len(missing))
        kept = FrameWork(self._job.files.folder, self._record.made_of, missing)

        def save(frame: int, result: Result) -> None:
            self._save(frame, result)
            kept.release(frame)

        try:
            with self._interruption.deferred(), kept, FrameWriter(save) as writer:
                for frame in missing:
                    if self._interruption.requested:
                        break
                    try:
                        result = self._trace(frame, kept.of(frame), progress)
                    except RenderInterrupted:
                        break
                    with self._statistics.phase("waiting"):
                        writer.write(frame, result)
                    progress.next_frame()
        finally:
            reporter.close()
        return progress.finished

    def _trace(self, frame: int, work: WorkFile, progress: FramesProgress) -> Result:
        """Raises `RenderInterrupted` where the user wants to stop before the frame's last band."""

        def report(done: int, total: int, rays: int) -> None:
            progress.update(done, total, rays)
            if done < total:
                self._interruption.check()

        earlier = seconds_in(work)
        scene = self._job.view.at(frame)
        result = render(scene, progress=report, work=work, animated=True, **self._wishes.settings)
        self._statistics.take(result, earlier)
        return result

    def _save(self, frame: int, result: Result) -> None:
        """The files of a frame, then its line in the record; in the writer's thread."""
        files = self._job.files.of(frame)
        started = time.perf_counter()
        for file in files:
            own = file.parent == self._job.files.folder
            result.save(file, **({} if own else self._wishes.file_options))
        if self._job.files.layers:
            result.save_layers(self._job.files.layer_base(frame))
        self._record.add(frame, self._job.files.all_of(frame), counts_in(result.stats))
        self._statistics.written(time.perf_counter() - started)

    def _stop(self, what: str) -> int:
        talk(f"{self._interruption.reason}: {what}; --resume goes on")
        return self._interruption.exit_code

    def _tell(self, rendered: int) -> None:
        frames, files = self._course.frames, self._job.files
        if self._wishes.stats:
            about = {"scene": self._job.scene.name, "tracer": __version__, "frames": [frames[0], frames[-1]]}
            statistics = about | self._statistics.summary(self._job.scene)
            save_statistics(statistics, files.folder.with_suffix(".stats.json"))
            click.echo(format_animation(statistics))
        if self._wishes.quiet:
            return
        names = [*files.movies, *(_span(template, frames) for template in files.pictures)]
        names += told_layers(str(files.layer_base(frames[0])), files.layers)
        kept = len(frames) - rendered
        were_kept = f" ({kept} {'was' if kept == 1 else 'were'} finished before)" if kept else ""
        number = f"{len(frames)} frame{'s' if len(frames) > 1 else ''}"
        click.echo(f"{', '.join(names)}  {number}{were_kept}  {self._statistics.speed()}")


def _span(template: str, frames: range) -> str:
    """`a.0001.png ... a.0120.png`."""
    names = [template.format(frame=frame) for frame in (frames[0], frames[-1])]
    return " ... ".join(dict.fromkeys(names))


def _made_of(job: Job, wishes: Wishes, backend: str) -> dict[str, Any]:
    """What the frames depend on, by the name that a refusal to go on tells."""
    scene = job.scene
    free = ("threads", "memory", "count_hits")
    options = {f"--{name}": value for name, value in wishes.settings.items() if name not in free}
    llvm = ".".join(map(str, ensure_llvm().version)) if backend == "llvm" else None
    return {
        "version of tracer": __version__,
        "version of LLVM": llvm,
        "scene": scene_hash(scene),
        "course of the camera": job.view.words,
        "content of a file of the scene": file_digests(scene),
        **options,
        "--backend": backend,
        **{f"--{name}": value for name, value in wishes.file_options.items()},
    }
