"""Runs terms on scenes: the one entry for the command, the report and the tests."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import tracer
from reference.comparison import (
    backends,
    cameras,
    chains,
    depths,
    direct_lights,
    directions,
    hits,
    lockstep,
    pictures,
    placements,
    seams,
    second_version,
    total_reflection,
    visibility,
)
from reference.comparison.case import Case
from reference.comparison.records import Outcome, Term
from reference.comparison.selection import Subject
from tracer.errors import UsageError

Progress = Callable[[int, int, Outcome], None]
"""(terms done, terms in all, the latest outcome), called after every term."""


def terms() -> list[Term]:
    """All terms, in the order of a report."""
    geometry = (
        placements,
        cameras,
        depths,
        hits,
        seams,
        visibility,
        direct_lights,
        lockstep,
        directions,
        total_reflection,
        chains,
    )
    rooms = (*geometry, pictures, second_version, backends)
    return [term for room in rooms for term in room.terms()]


def find_terms(names: Sequence[str]) -> list[Term]:
    """The terms of these names; raises `UsageError` for one that does not exist."""
    known = {term.name: term for term in terms()}
    wrong = [name for name in names if name not in known]
    if wrong:
        raise UsageError(f"term: {wrong[0]!r} is unknown; allowed are {'; '.join(known)}")
    return [known[name] for name in names]


def run(
    scenes: Sequence[tracer.Scene | Subject],
    terms: Sequence[Term],
    precisions: Sequence[str] = ("single", "double"),
    rays: int = 20_000,
    progress: Progress | None = None,
    backend: str = "llvm",
    seed: int = 0,
) -> list[Outcome]:
    """The outcomes of the terms that apply, scene by scene and precision by precision. A `Subject` says how a
    replay names its scene, else the scene's name does.

    Raises `MachineError` without Mitsuba, `SceneError` for a scene that cannot be compiled, `UsageError`
    where no term applies.
    """
    subjects = [scene if isinstance(scene, Subject) else Subject(scene, scene.name) for scene in scenes]
    work = [
        (subject, precision, [term for term in terms if term.suits(subject.scene, precision)])
        for subject in subjects
        for precision in precisions
    ]
    total = sum(len(applicable) for *_, applicable in work)
    if not total:
        raise UsageError("there is nothing to compare: no term applies to a scene that is named")
    outcomes: list[Outcome] = []
    case: Case | None = None
    for subject, precision, applicable in work:
        if case is None or case.scene is not subject.scene:
            case = Case(subject.scene, backend=backend, rays=rays, seed=seed, words=subject.words)
        case = case.in_precision(precision)
        for term in applicable:
            outcomes.append(term.run(case))
            if progress is not None:
                progress(len(outcomes), total, outcomes[-1])
    return outcomes
