"""What `tracer render --frames` and `tracer turntable` do: frame after frame, then the movies of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import click

from tracer.backends import find_backend
from tracer.cli.animation_statistics import AnimationStatistics, format_animation
from tracer.cli.failures import report, talk, worst_of
from tracer.cli.frame_names import FrameFiles, frame_files
from tracer.cli.frame_writer import FrameWriter
from tracer.cli.interruption import Interruption
from tracer.cli.layers import LOST_LAYERS, loses_layers, told_layers
from tracer.cli.pictures import Wishes, warn
from tracer.cli.progress import make_reporter
from tracer.cli.statistics import save_statistics
from tracer.errors import OutputError, TracerError, UsageError
from tracer.film.counts import counts_in
from tracer.film.false_color import picture_names
from tracer.film.frame_record import FrameRecord
from tracer.film.movie import write_movie
from tracer.film.result import Result
from tracer.render import render, scene_hash
from tracer.scene import Scene, find_scene, load
from tracer.scene.files import file_digests
from tracer.scene_warnings import warnings_of
from tracer.settings import Settings, picture_canvas, picture_rectangle
from tracer.version import __version__


@dataclass(frozen=True)
class Course:
    """Which `frames` are rendered, and at how many frames a second their movie plays (`rate`)."""

    frames: range
    rate: float


@dataclass(frozen=True)
class View:
    """A scene over time: `at` gives the scene at a frame; `words` say what the camera does, the same words
    the same thing."""

    at: Callable[[int], Scene]
    words: str


@dataclass(frozen=True)
class _Job:
    """One animation: its scene as the user called it and loaded, the scene over time, its files."""

    source: str
    scene: Scene
    view: View
    files: FrameFiles


def render_animations(
    sources: Sequence[str],
    wishes: Wishes,
    course: Course,
    view_of: Callable[[Scene], View],
    default_output: str,
    interruption: Interruption,
) -> int:
    """Renders an animation of each scene and returns the exit code; a bad scene does not stop the others."""
    interruption.quiet = wishes.quiet
    checked = Settings(**wishes.settings).checked()
    backend = find_backend(wishes.backend, wishes.precision).name
    templates = wishes.outputs or (default_output,)
    if not wishes.aov_png and loses_layers(wishes.aovs, templates):
        warn(LOST_LAYERS, wishes)
    worst, jobs, folders = 0, [], set()
    for source in sources:
        try:
            files = frame_files(templates, find_scene(source)[0].stem, course.frames)
            if files.folder in folders:
                raise UsageError(f"{templates[0]}: {{name}} in it gives each scene files of its own")
            scene = load(source, allow_outside=wishes.allow_outside, overrides=wishes.overrides)
            picture_rectangle(checked.crop, picture_canvas(scene, checked))
            if wishes.aov_png:
                files = replace(files, layers=tuple(picture_names(checked.aovs, len(scene.lights))))
            view = view_of(scene)
            for frame in course.frames:
                view.at(frame)  # values that do not fit together are told before the first ray
        except TracerError as error:
            worst = max(worst, report(error))
        else:
            folders.add(files.folder)
            jobs.append(_Job(source, scene, view, files))
    made = worst_of(
        jobs, lambda job: _Animation(job, wishes, course, backend, interruption).make(), interruption
    )
    return max(worst, made)


class _Animation:
    """One animation on its way from the scene to the files."""

    def __init__(
        self, job: _Job, wishes: Wishes, course: Course, backend: str, interruption: Interruption
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
        rays = 0
        done = 0
        try:
            with self._interruption.deferred(), FrameWriter(self._save) as writer:
                for frame in missing:
                    if self._interruption.requested:
                        break
                    result = self._trace(frame, len(missing), done, rays, reporter.update)
                    rays += sum(result.stats["rays"].values())
                    with self._statistics.phase("waiting"):
                        writer.write(frame, result)
                    done += 1
        finally:
            reporter.close()
        return done

    def _trace(
        self, frame: int, frames: int, before: int, rays: int, update: Callable[[int, int, int], None]
    ) -> Result:
        def progress(done: int, total: int, rays_so_far: int) -> None:
            update(before * total + done, frames * total, rays + rays_so_far)

        result = render(self._job.view.at(frame), progress=progress, **self._wishes.settings)
        self._statistics.take(result)
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
        click.echo(f"{', '.join(names)}  {len(frames)} frames{were_kept}  {self._statistics.speed()}")


def _span(template: str, frames: range) -> str:
    """`a.0001.png ... a.0120.png`."""
    names = [template.format(frame=frame) for frame in (frames[0], frames[-1])]
    return " ... ".join(dict.fromkeys(names))


def _made_of(job: _Job, wishes: Wishes, backend: str) -> dict[str, Any]:
    """What the frames depend on, by the name that a refusal to go on tells."""
    scene = job.scene
    free = ("threads", "memory", "count_hits")
    options = {f"--{name}": value for name, value in wishes.settings.items() if name not in free}
    return {
        "version of tracer": __version__,
        "scene": scene_hash(scene),
        "course of the camera": job.view.words,
        "content of a file of the scene": file_digests(scene),
        **options,
        "--backend": backend,
        **{f"--{name}": value for name, value in wishes.file_options.items()},
    }
