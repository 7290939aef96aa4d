"""The parts of a Mitsuba scene file: bodies, sensor, comments."""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Comment, Element, SubElement

import numpy as np

from reference.adapters.geometry import Ball, Disk, Perspective, Triangles
from reference.mitsuba_looks import add, numbers


def analytic(body: Ball | Disk) -> Element:
    """The `shape` element of a body that Mitsuba solves in closed form."""
    if isinstance(body, Ball):
        element = Element("shape", type="sphere")
        add_point(element, "center", body.center)
        add(element, "float", "radius", body.radius)
        return element
    element = Element("shape", type="disk")
    u, v = body.tangents()
    frame = np.eye(4)
    frame[:3] = np.stack([u, v, body.normal, -body.d * body.normal], axis=1)
    transform = SubElement(element, "transform", name="to_world")
    # Two steps: the inverse of their product would lose digits in single precision.
    SubElement(transform, "scale", x=repr(body.radius), y=repr(body.radius), z="1.0")
    SubElement(transform, "matrix", value=numbers(frame).replace(",", ""))
    return element


def square(disk: Disk, half: float) -> Triangles:
    """Two triangles in place of a disk: the coordinates of Mitsuba's disk are polar."""
    u, v = disk.tangents()
    center = -disk.d * disk.normal
    a, b, c, d = (center + half * (x * u + y * v) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    corners = np.array([[a, b, c], [a, c, d]]).astype(np.float32).astype(np.float64)
    return Triangles(corners, np.arange(2))


def sensor(view: Perspective) -> Element:
    """The `sensor` element; the parameter `spp` is the number of samples a pixel."""
    element = Element("sensor", type="perspective")
    add(element, "float", "fov", view.fov)
    add(element, "string", "fov_axis", "x")
    for axis, shift in zip("xy", view.shift, strict=True):
        add(element, "float", f"principal_point_offset_{axis}", shift)
    add(element, "float", "near_clip", view.near)
    add(element, "float", "far_clip", view.far)
    transform = SubElement(element, "transform", name="to_world")
    SubElement(transform, "matrix", value=numbers(view.to_world()).replace(",", ""))
    film = SubElement(element, "film", type="hdrfilm")
    add(film, "integer", "width", view.width)
    add(film, "integer", "height", view.height)
    add(film, "string", "pixel_format", "rgb")
    add(film, "string", "component_format", "float32")
    SubElement(film, "rfilter", type="box")
    sampler = SubElement(element, "sampler", type="independent")
    add(sampler, "integer", "sample_count", "$spp")
    return element


def add_point(parent: Element, name: str, point: np.ndarray) -> None:
    """Appends a point (3,)."""
    x, y, z = (repr(float(value)) for value in point)
    SubElement(parent, "point", name=name, x=x, y=y, z=z)


def comment(text: str) -> Any:
    """A comment; what XML forbids in one is replaced."""
    allowed = "".join(c if c.isprintable() or c == "\n" else "?" for c in text)
    while "--" in allowed:
        allowed = allowed.replace("--", "- -")
    return Comment(f" {allowed} ")
