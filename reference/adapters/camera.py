"""The camera in Mitsuba's terms.

Both forms of the camera come down to an eye and a canvas. Mitsuba's rays start on its near plane, so with the
canvas as near plane a distance along the ray is the document's depth.
"""

from __future__ import annotations

import math

from reference.adapters.geometry import Perspective
from tracer.canvas import Canvas

FAR = 1e8
"""Least distance of the far plane; Mitsuba's own 1e4 cuts off scenes in pixel units."""

FAR_FACTOR = 1e6
"""The far plane in scene extents: beyond the disks that stand for planes."""


def perspective(canvas: Canvas, extent: float, supersample: int = 1) -> Perspective:
    """The sensor whose sample at the center of part (a, b) of a pixel is the ray through (a + delta)/n.

    The principal point carries what `pixel_offset` differs from 1/2 by.
    """
    shift = (canvas.offset - 0.5) / supersample
    return Perspective(
        eye=canvas.eye,
        x=canvas.x,
        y=canvas.y,
        forward=canvas.forward,
        fov=math.degrees(2 * math.atan(canvas.width * canvas.pixel_size / (2 * canvas.distance))),
        shift=(shift / canvas.width, shift / canvas.height),
        near=canvas.distance,
        far=max(FAR, FAR_FACTOR * extent),
        width=canvas.width,
        height=canvas.height,
        samples=supersample,
    )
