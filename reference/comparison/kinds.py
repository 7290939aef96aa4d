"""Kinds of shapes, and terms that are compared kind by kind."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import tracer
from reference.comparison.case import Case
from reference.comparison.materials import material_of
from reference.comparison.records import Outcome, Term
from reference.comparison.truth import MESH, PLANE, SPHERE
from tracer.shapes import Instance, Mesh, Plane, Sphere

KINDS: dict[str, tuple[type, ...]] = {PLANE: (Plane,), SPHERE: (Sphere,), MESH: (Mesh, Instance)}
"""The records of each kind of shape."""


def has_shapes(scene: tracer.Scene) -> bool:
    """Whether there is anything to hit."""
    return bool(scene.shapes)


def has_kind(kind: str, scene: tracer.Scene) -> bool:
    """Whether a scene has a shape of that kind."""
    return any(isinstance(shape, KINDS[kind]) for shape in scene.shapes)


def glass_kinds(scene: tracer.Scene) -> set[str]:
    """The kinds of the shapes whose index of refraction is not 1."""
    return {
        kind
        for number, shape in enumerate(scene.shapes)
        for kind, records in KINDS.items()
        if isinstance(shape, records) and material_of(scene, number).ior != 1
    }


def by_kind(
    name: str,
    compares: str,
    run: Callable[[Case, str], Outcome],
    applies: Callable[[str, tracer.Scene], bool] = has_kind,
) -> list[Term]:
    """A term for each kind of shape, named `NAME, KIND`."""
    return [
        Term(
            f"{name}, {kind}",
            f"{compares}, of a {kind}",
            partial(applies, kind),
            partial(_run, run, kind),
        )
        for kind in KINDS
    ]


def _run(run: Callable[[Case, str], Outcome], kind: str, case: Case) -> Outcome:
    return run(case, kind)
