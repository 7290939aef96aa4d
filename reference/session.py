"""A run as `tracer validate` asks for it: which scenes and terms, and which files it writes."""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace

import tracer
from reference.comparison import Outcome, Progress, Term, Validation, all_terms, find_terms, run
from reference.comparison.selection import FULL_RAYS, STANDARD_RAYS, Subject, chosen_scenes
from reference.report import (
    header_of,
    headline_place,
    rewrite_headline,
    summary_markdown,
    write_json,
    write_report,
)
from reference.report.destination import Destination
from tracer.backends import find_backend, has_cuda
from tracer.film.atomic import atomic_write, check_writable
from tracer.scene import load

PARTIAL_PAGE = "index.partial.html"


@dataclass(frozen=True)
class Request:
    """What is to be compared. `scenes`: files and names; `rays`: a scene, None: as `full` says; `backend`:
    ours; `command`: the line that repeats the run."""

    scenes: tuple[str, ...]
    full: bool
    random: int | None
    seed: int
    rays: int | None
    terms: tuple[str, ...]
    precisions: tuple[str, ...]
    backend: str
    overrides: tuple[str, ...]
    allow_outside: bool
    command: str

    def subjects(self) -> list[Subject]:
        """The scenes, and how a command names them; raises `SceneError`."""

        def load_one(name: str) -> tracer.Scene:
            return load(name, allow_outside=self.allow_outside, overrides=self.overrides)

        options = [f"--set {shlex.quote(override)}" for override in self.overrides]
        options += ["--allow-outside"] if self.allow_outside else []
        return [
            replace(subject, words=" ".join([subject.words, *options]))
            for subject in chosen_scenes(self.scenes, self.full, self.random, self.seed, load_one)
        ]

    def find_terms(self) -> list[Term]:
        """The terms; raises `UsageError` for one that does not exist."""
        return find_terms(self.terms) if self.terms else all_terms()

    @property
    def rays_a_scene(self) -> int:
        """How many rays each scene gets."""
        return self.rays or (FULL_RAYS if self.full else STANDARD_RAYS)

    @property
    def processor(self) -> str:
        """Our backend, with `auto` decided; raises `MachineError` where the machine lacks it."""
        return str(find_backend(self.backend, "double").name)


@dataclass(frozen=True)
class Files(Destination):
    """Where a comparison goes; `headline`: the file whose headline is rewritten, if asked for."""

    headline: str | None = None

    def check(self) -> None:
        """Also refuses a headline without a place. Raises `OutputError`, `UsageError`."""
        super().check()
        if self.headline:
            check_writable(self.headline, (".md",))
            headline_place(self.headline)

    def write(self, validation: Validation) -> list[str]:
        """Writes all files and returns their names."""
        write_report(self.page, validation)
        write_json(self.twin, validation)
        written = [self.page, self.twin]
        if self.json:
            write_json(self.json, validation)
            written.append(self.json)
        if self.summary:
            with atomic_write(self.summary) as temporary:
                temporary.write_text(summary_markdown(validation), encoding="utf-8")
            written.append(self.summary)
        if self.headline:
            rewrite_headline(self.headline, validation)
            written.append(self.headline)
        return written

    def write_partial(self, validation: Validation) -> str:
        """Writes the page of a run that was stopped, under a name of its own."""
        page = os.path.join(self.out, PARTIAL_PAGE)
        write_report(page, validation)
        return page


def compare(request: Request, subjects: Sequence[Subject], progress: Progress) -> list[Outcome]:
    """All outcomes of a run. Raises `UsageError` for an unknown term, `MachineError` for a backend that the
    machine lacks."""
    return run(
        subjects,
        request.find_terms(),
        request.precisions,
        request.rays_a_scene,
        progress,
        request.processor,
        request.seed,
    )


def validation_of(request: Request, outcomes: Sequence[Outcome], notes: Sequence[str] = ()) -> Validation:
    """The outcomes with the head of a report, and with notes on what was left out."""
    header = header_of(
        request.command, request.precisions, request.processor, request.rays_a_scene, request.seed
    )
    return Validation(header, tuple(outcomes), (*notes, *left_out(request)))


def left_out(request: Request) -> list[str]:
    """What this run did not compare, and why."""
    notes = []
    if not has_cuda():
        notes.append("CUDA against LLVM was not compared: there is no NVIDIA GPU here.")
    if request.terms:
        notes.append(f"Only these terms were asked for: {', '.join(request.terms)}.")
    if not request.full:
        notes.append("This is not the full run; `tracer validate --full` compares every built-in scene.")
    return notes
