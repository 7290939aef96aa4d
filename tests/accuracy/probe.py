"""Bounces at the Dr.Jit level: a free ray hits, then another leaves that point on a chosen side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

import tracer
from tracer.backends import INVALID, exact_arithmetic, find_backend
from tracer.device_scene import DeviceScene, compile_scene
from tracer.intersection import closest_hit, free_ray
from tracer.leaving import leave
from tracer.occlusion import hidden
from tracer.ray import Segment, max_abs, normalize
from tracer.shafts import Ball, Suspects
from tracer.surface import surface_at
from tracer.suspects import find_suspects

Array = np.ndarray


@dataclass(frozen=True)
class Bounce:
    """First hits: `shape`, `primitive` (within the shape; -1: none), `p`, `outward`, `entering`; and what
    the rays that leave meet: `next_shape`, `next_primitive`, `t`; `blocked`: a light at `length` is
    hidden."""

    valid: Array
    shape: Array
    primitive: Array
    p: Array
    outward: Array
    entering: Array
    next_valid: Array
    next_shape: Array
    next_primitive: Array
    t: Array
    blocked: Array


def compiled(table: dict[str, Any], precision: str = "single") -> DeviceScene:
    """The tables of a scene given as a dict."""
    return compile_scene(tracer.load(table), find_backend("llvm", precision))


def upload(device: DeviceScene, vectors: Array) -> Any:
    """(n, 3) to a Dr.Jit vector."""
    types = device.backend
    return types.Vector3(*(types.Float(np.ascontiguousarray(c, types.dtype)) for c in vectors.T))


def bounce(device: DeviceScene, o: Array, d_in: Array, d_out: Array, crosses: bool, length: float) -> Bounce:
    """Rays (o, d_in) hit the scene; from there d_out leaves, through the surface when `crosses`."""
    with exact_arithmetic():
        ray = free_ray(device, upload(device, o), normalize(upload(device, d_in)))
        everything = dr.full(device.backend.Bool, True, len(o))
        hit = closest_hit(device, ray, everything)
        surface = surface_at(device, ray, hit, everything)
        valid = hit.valid
        dr.eval(hit, surface, valid)
        onward = leave(ray, surface, normalize(upload(device, d_out)), crosses)
        dr.eval(onward)
        second = closest_hit(device, onward, valid)
        met = surface_at(device, onward, second, valid)
        none = dr.zeros(device.backend.UInt32, len(o))
        far = device.backend.opaque(length)  # a number in the kernel would be a kernel for each length
        segment = Segment(
            onward, dr.zeros(device.backend.Float, len(o)) + far, onward.o + far * onward.d, none, none
        )
        light = Ball(segment.light, 64 * device.backend.epsilon * max_abs(segment.light))
        if crosses:  # no shadow ray does, but the rules of contact hold
            surface.lit_side = -surface.lit_side
        who = (
            Suspects.everybody(device.backend, len(o))
            if crosses
            else find_suspects(device, surface, light, valid, spheres=True, beams=True)
        )
        blocked = hidden(device, segment, surface, who, valid)
        dr.eval(second, met, blocked)
    first = device.host.first_primitive

    def within(primitive: Any, shape: Array) -> Array:
        ids = primitive.numpy()
        return np.where(ids != INVALID, ids - first[np.maximum(shape, 0)], -1)

    shape = np.where(valid.numpy(), surface.shape.numpy().astype(np.int64), -1)
    next_valid = second.primitive.numpy() != INVALID
    next_shape = np.where(next_valid, met.shape.numpy().astype(np.int64), -1)
    return Bounce(
        valid=valid.numpy(),
        shape=shape,
        primitive=within(hit.primitive, shape),
        p=np.where(valid.numpy()[:, None], surface.p.numpy().T, 0).astype(np.float64),
        outward=surface.outward.numpy().T.astype(np.float64),
        entering=surface.entering.numpy(),
        next_valid=next_valid,
        next_shape=next_shape,
        next_primitive=within(second.primitive, next_shape),
        t=second.t.numpy().astype(np.float64),
        blocked=blocked.numpy(),
    )


def unit(v: Array) -> Array:
    """v / |v| along the last axis."""
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def directions(rng: np.random.Generator, n: int) -> Array:
    """Uniform on the sphere."""
    return unit(rng.normal(size=(n, 3)))


def rotation(rng: np.random.Generator) -> Array:
    """A random rotation matrix."""
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))
