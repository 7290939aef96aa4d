"""Everything that the kernel of `reference.whitted` reads: geometry, tables, lights, canvas, options."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

import tracer
from reference import plain
from reference.mitsuba_scene import build
from reference.whitted_lights import Light, opaque_vector, read_lights
from reference.whitted_tables import TableMaker, Tables, plain_world
from reference.whitted_types import Array3f, Float, UInt32, dr

START = 1e-5
"""Rays start so far from the surface they leave, along themselves, in sizes of coordinates: ten times nearer,
grazing rays hit it again; Mitsuba's own start is moved along the normal, which shifts the line."""

CUTOFF_SLACK = 1e-6  # a child is traced when w k > cutoff - 1e-6 (document, section 3)


@dataclass(frozen=True)
class Canvas:
    """The camera in memory: from the pixel coordinate (x, y) the ray starts at center + (x - w/2) right +
    (y - h/2) down, away from the eye, which is `forward` (with the length of the distance) behind the center.
    """

    center: Array3f
    right: Array3f
    down: Array3f
    forward: Array3f
    half_width: Float
    half_height: Float
    offset: Float
    width: UInt32

    @staticmethod
    def of(camera: plain.Camera) -> Canvas:
        """The canvas of the plain version's camera."""
        return Canvas(
            center=opaque_vector(camera.center),
            right=opaque_vector(camera.pixel_size * camera.right),
            down=opaque_vector(camera.pixel_size * camera.down),
            forward=opaque_vector(camera.distance * camera.forward),
            half_width=dr.opaque(Float, camera.width / 2),
            half_height=dr.opaque(Float, camera.height / 2),
            offset=dr.opaque(Float, camera.pixel_offset),
            width=dr.opaque(UInt32, camera.width),
        )


@dataclass(frozen=True)
class Options:
    """What is part of the kernel: the scene's options, and what its materials never ask for.

    `stack`: rays that may wait at most; `level_bound`: whether a path can get as deep as `max_depth`;
    `white`: all lights are; `straight`: a refracting material has the index 1.
    """

    transparent_shadows: bool
    reflect_totally: bool
    secondary_background: bool
    diffuse_reflection: bool
    white: bool
    straight: bool
    level_bound: bool
    max_depth: int
    stack: int

    @staticmethod
    def of(world: plain.World) -> Options:
        """The options of a scene."""
        materials = [shape.material for shape in world.shapes]
        least = world.cutoff - CUTOFF_SLACK
        largest = max((k for m in materials for k in (m.reflection, m.refraction)), default=0.0)
        deepest = math.inf if largest >= 1 else math.log(least) / math.log(largest) if largest > 0 else 0.0
        splits = any(m.reflection > 0 and m.refraction > 0 for m in materials)
        return Options(
            transparent_shadows=world.transparent_shadows,
            reflect_totally=world.reflect_totally,
            secondary_background=world.secondary_background,
            diffuse_reflection=world.diffuse_reflection,
            white=all(light.color == plain.WHITE for light in world.lights),
            straight=any(m.ior == 1 and m.refraction > 0 for m in materials),
            level_bound=deepest >= world.max_depth,
            max_depth=world.max_depth,
            stack=int(1 / least) if splits else 1,
        )


@dataclass(frozen=True)
class World:
    """A scene in memory; `extent` S and `start`, the share of it after which secondary rays start."""

    scene: Any  # mi.Scene
    tables: Tables
    lights: list[Light]
    canvas: Canvas
    ambient: Float
    background: Array3f
    least_weight: Float
    extent: Float
    start: Float
    seed: UInt32
    options: Options


def world_of(scene: tracer.Scene, supersample: int, start: float = START, reach: float = 1.0) -> World:
    """The scene in memory; `reach`: by how much the disks that stand for planes are larger than usual."""
    read = plain_world(scene)
    geometry = build(scene, supersample, reach=reach)
    return World(
        scene=geometry.scene,
        tables=TableMaker(read, geometry.numbers.tolist()).tables(),
        lights=read_lights(read),
        canvas=Canvas.of(read.camera),
        ambient=dr.opaque(Float, read.ambient),
        background=opaque_vector(read.background),
        least_weight=dr.opaque(Float, np.float64(read.cutoff - CUTOFF_SLACK)),
        extent=dr.opaque(Float, geometry.extent),
        start=dr.opaque(Float, start),
        seed=dr.opaque(UInt32, read.seed % 2**32),
        options=Options.of(read),
    )
