"""Kinds of shapes, and terms that are compared kind by kind."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import tracer
from reference.comparison.case import Case
from reference.comparison.records import Outcome, Term
from reference.comparison.truth import MESH, PLANE, SPHERE
from tracer.shapes import Instance, Mesh, Plane, Sphere

KINDS = {PLANE: (Plane,), SPHERE: (Sphere,), MESH: (Mesh, Instance)}
"""The records of each kind of shape."""


def has_shapes(scene: tracer.Scene) -> bool:
    """Whether there is anything to hit."""
    return bool(scene.shapes)


def has_kind(kind: str, scene: tracer.Scene) -> bool:
    """Whether a scene has a shape of that kind."""
    return any(isinstance(shape, KINDS[kind]) for shape in scene.shapes)


def has_glass(scene: tracer.Scene) -> bool:
    """Whether a material of the scene refracts."""
    return has_shapes(scene) and any(material.ior != 1 for material in scene.materials.values())


def by_kind(
    name: str,
    compares: str,
    run: Callable[[Case, str], Outcome],
    applies: Callable[[tracer.Scene], bool] = has_shapes,
) -> list[Term]:
    """A term for each kind of shape, named `NAME, KIND`."""
    return [
        Term(
            f"{name}, {kind}",
            f"{compares}, of a {kind}",
            partial(_applies, kind, applies),
            partial(_run, run, kind),
        )
        for kind in KINDS
    ]


def _applies(kind: str, applies: Callable[[tracer.Scene], bool], scene: tracer.Scene) -> bool:
    return has_kind(kind, scene) and applies(scene)


def _run(run: Callable[[Case, str], Outcome], kind: str, case: Case) -> Outcome:
    return run(case, kind)
