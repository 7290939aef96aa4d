"""What `tracer render --frames` and `tracer turntable` do: every scene is checked, then frame after frame is
rendered, then the movies of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from tracer.backends import find_backend
from tracer.cli.animation_job import Course, Job, View
from tracer.cli.animation_run import AnimationRun
from tracer.cli.failures import report, worst_of
from tracer.cli.frame_names import frame_files
from tracer.cli.interruption import Interruption
from tracer.cli.layers import LOST_LAYERS, loses_layers
from tracer.cli.wishes import Wishes, warn
from tracer.errors import TracerError, UsageError
from tracer.film.false_color import picture_names
from tracer.scene import Scene, find_scene, load
from tracer.settings import Settings, picture_canvas, picture_rectangle


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
            jobs.append(Job(source, scene, view, files))
    made = worst_of(
        jobs, lambda job: AnimationRun(job, wishes, course, backend, interruption).make(), interruption
    )
    return max(worst, made)
