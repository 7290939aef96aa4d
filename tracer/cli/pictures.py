"""What `tracer render` and `tracer classic` do: plan, trace, save, tell; one scene after the other."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

import click

from tracer.backends import find_backend
from tracer.cli.failures import talk, worst_of
from tracer.cli.interruption import Interruption
from tracer.cli.layers import LOST_LAYERS, loses_layers, told_layers
from tracer.cli.plan import Job, make_plan, partial_file, statistics_file, work_file
from tracer.cli.progress import make_reporter
from tracer.cli.statistics import (
    format_statistics,
    picture_statistics,
    save_statistics,
    seconds_since_start,
)
from tracer.cli.wishes import Wishes, warn
from tracer.errors import OutputError
from tracer.film.result import Result
from tracer.film.work_file import WorkFile
from tracer.render import RenderInterrupted, render
from tracer.scene import Scene, load
from tracer.scene_warnings import warnings_of


def render_scenes(
    sources: Sequence[str],
    wishes: Wishes,
    interruption: Interruption,
    load_scene: Callable[[str], Scene] | None = None,
) -> int:
    """Renders all scenes and returns the exit code; `load_scene` stands in for loading a source as it is."""

    def load_source(source: str) -> Scene:
        return load(source, allow_outside=wishes.allow_outside, overrides=wishes.overrides)

    interruption.quiet = wishes.quiet
    imported = seconds_since_start()
    plan = make_plan(sources, wishes.outputs, load_scene or load_source, wishes.settings, wishes.aov_png)
    if not plan.jobs:
        return plan.worst
    find_backend(wishes.backend, wishes.precision)
    if not wishes.aov_png and loses_layers(wishes.aovs, [file for job in plan.jobs for file in job.files]):
        warn(LOST_LAYERS, wishes)

    def make(job: Job) -> int:
        return _Picture(job, wishes, interruption, imported if job is plan.jobs[0] else 0.0).make()

    return max(plan.worst, worst_of(plan.jobs, make, interruption))


class _Picture:
    """One picture on its way from the scene to the files."""

    def __init__(self, job: Job, wishes: Wishes, interruption: Interruption, imported: float) -> None:
        self._job, self._wishes, self._interruption = job, wishes, interruption
        self._seconds = {"imports": imported, "load": job.load_seconds}
        self._percent = 0
        self._work = WorkFile(work_file(job.files[0]), wishes.resume)

    def make(self) -> int:
        """Traces and saves; returns the exit code."""
        started = time.perf_counter()
        for warning in warnings_of(self._job.scene):
            warn(warning, self._wishes)
        self._tell_of_earlier_work()
        self._seconds["load"] += time.perf_counter() - started
        try:
            result = self._trace()
            writing = time.perf_counter()
            self._save(result)
        except RenderInterrupted as interrupted:
            self._save_partial(interrupted.partial)
            return self._interruption.exit_code
        except OutputError as error:
            raise OutputError(f"{error}{self._how_to_go_on()}") from error
        finally:
            self._work.close()
        self._seconds |= result.stats["seconds"] | {"write": time.perf_counter() - writing}
        self._tell(result, self._job.load_seconds + time.perf_counter() - started)
        return 0

    def _tell_of_earlier_work(self) -> None:
        if self._work.exists() != self._wishes.resume and not self._wishes.quiet:
            talk(
                f"{self._work.path}: there is no such file to resume, so {self._job.source} begins anew"
                if self._wishes.resume
                else f"{self._work.path}: is left of a run that was stopped; without --resume it is dropped"
            )

    def _trace(self) -> Result:
        """The picture; `RenderInterrupted` also where the user's wish to stop came after the last ray."""
        reporter = make_reporter(self._wishes.reporter, self._job.scene.name)

        def progress(done: int, total: int, rays: int) -> None:
            self._percent = 100 * done // total
            reporter.update(done, total, rays)
            self._interruption.check()

        try:
            with self._interruption.deferred():
                result = render(self._job.scene, progress=progress, work=self._work, **self._wishes.settings)
                if self._interruption.requested:
                    raise RenderInterrupted(result)
        finally:
            reporter.close()
        return result

    def _save(self, result: Result) -> None:
        """Writes the files, after which what an interrupted run left has done its service."""
        for file in self._job.files:
            result.save(file, **self._wishes.file_options)
        if self._wishes.aov_png:
            result.save_layers(self._job.files[0])
        self._work.remove()
        if self._wishes.resume:
            Path(partial_file(self._job.files[0])).unlink(missing_ok=True)

    def _tell(self, result: Result, seconds: float) -> None:
        lost = result.stats["ended_by_depth"]
        if lost:
            warn(
                f"{self._job.scene.name}: max_depth = {self._job.scene.max_depth} ended {lost} "
                f"path{'s' if lost > 1 else ''} whose light is missing",
                self._wishes,
            )
        if self._wishes.stats:
            statistics = picture_statistics(result, self._job.scene, self._seconds)
            save_statistics(statistics, statistics_file(self._job.files[0]))
            click.echo(format_statistics(statistics))
        if not self._wishes.quiet:
            height, width = result.depth.shape
            tracing = result.stats["seconds"]["compile"] + result.stats["seconds"]["trace"]
            speed = sum(result.stats["rays"].values()) / max(tracing, 1e-9) / 1e6
            files = ", ".join((*self._job.files, *told_layers(self._job.files[0], self._job.layers)))
            click.echo(f"{files}  {width}x{height}  {seconds:.2f} s  {speed:.1f} Mrays/s")

    def _save_partial(self, partial: Result) -> None:
        """Saves the finished pixels beside the first output and says how to render the others."""
        file = partial_file(self._job.files[0])
        partial.save(file, **self._wishes.file_options)
        talk(
            f"{self._interruption.reason}: {file} holds the finished {self._percent} % of "
            f"{self._job.source}{self._how_to_go_on()}"
        )

    def _how_to_go_on(self) -> str:
        """The end of a sentence about a picture that is not finished."""
        if not self._work.started:
            return ""
        return f"; the same command with --resume goes on from {self._work.path}"
