"""Everything that can be refused before the first ray: scenes, file names, ranges."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from tracer.cli.failures import report
from tracer.errors import OutputError, TracerError, UsageError
from tracer.film.atomic import check_writable, fill_template
from tracer.film.false_color import picture_names
from tracer.film.result import layer_file
from tracer.scene import Scene, find_scene
from tracer.settings import Settings, picture_canvas, picture_rectangle

DEFAULT_OUTPUT = "{name}.png"


@dataclass(frozen=True)
class Job:
    """One picture: its scene, as the user called it and loaded, and the files it goes to."""

    source: str
    scene: Scene
    files: tuple[str, ...]
    load_seconds: float
    layers: tuple[str, ...] = ()  # names of the layers that become pictures as well


@dataclass
class Plan:
    """What is to be rendered, and the worst exit code of what is not."""

    jobs: list[Job]
    worst: int = 0

    def refuse(self, error: TracerError) -> None:
        """Says what is wrong with one scene; the others go on."""
        self.worst = max(self.worst, report(error))


def make_plan(
    sources: Sequence[str],
    templates: Sequence[str],
    load_scene: Callable[[str], Scene],
    settings: dict[str, Any],
    aov_png: bool = False,
) -> Plan:
    """Loads and checks all scenes, each with `load_scene`; a bad one is reported and left out. `aov_png`:
    whether layers become pictures.

    Raises `UsageError` or `OutputError` for what concerns them all: options, files that cannot be written.
    """
    checked = Settings(**settings).checked()
    plan = Plan([])
    owners: dict[str, str] = {}
    files = _output_files(sources, templates or (DEFAULT_OUTPUT,), plan, owners)
    for source in files:
        started = time.perf_counter()
        try:
            scene = load_scene(source)
            picture_rectangle(checked.crop, picture_canvas(scene, checked))
            layers = picture_names(checked.aovs, len(scene.lights)) if aov_png else ()
            for layer in layers:
                _claim(str(layer_file(files[source][0], layer)), source, owners)
        except TracerError as error:
            plan.refuse(error)
        else:
            plan.jobs.append(Job(source, scene, files[source], time.perf_counter() - started, tuple(layers)))
    return plan


def _output_files(
    sources: Sequence[str], templates: Sequence[str], plan: Plan, owners: dict[str, str]
) -> dict[str, tuple[str, ...]]:
    """The files of every scene that exists; each file belongs to one scene (`owners`) and can be written."""
    files: dict[str, tuple[str, ...]] = {}
    for source in sources:
        try:
            name = find_scene(source)[0].stem
        except TracerError as error:
            plan.refuse(error)
            continue
        files[source] = tuple(fill_template(template, name) for template in templates)
        for file in files[source]:
            _claim(file, source, owners)
    return files


def _claim(file: str, source: str, owners: dict[str, str]) -> None:
    """Gives a file that can be written to a scene."""
    real = os.path.realpath(file)
    if real in owners:
        other = owners[real]
        who = f"twice for {source}" if other == source else f"for {other} and for {source}"
        raise UsageError(
            f"{file}: would be written {who}; allowed: a file of its own each, such as -o {{name}}.png"
        )
    owners[real] = source
    check_writable(file)


def partial_file(file: str) -> str:
    """Where an interrupted picture goes: `out/a.partial.png` for `out/a.exr`; raises `OutputError`."""
    name = f"{os.path.splitext(file)[0]}.partial.png"
    if os.path.isdir(name):
        raise OutputError(f"{name}: is a folder, so the interrupted picture is lost")
    return name


def work_file(file: str) -> str:
    """Where finished bands of a picture are kept: `out/a.work` for `out/a.exr`."""
    return f"{os.path.splitext(file)[0]}.work"


def statistics_file(file: str) -> str:
    """Where the statistics of a picture go: `out/a.stats.json` for `out/a.exr`."""
    return f"{os.path.splitext(file)[0]}.stats.json"
