"""The camera in POV-Ray's terms: eye and canvas as they are, with the ray at its place in the pixel."""

from __future__ import annotations

from reference.povray.text import Space
from tracer.canvas import Canvas


def perspective(canvas: Canvas, space: Space) -> str:
    """The statement for both forms of the camera; rays start at the eye, not on the canvas.

    POV-Ray aims at the middle of a pixel; what `pixel_offset` differs from 1/2 by shifts the direction.
    """
    shift = (canvas.offset - 0.5) * canvas.pixel_size
    direction = canvas.distance * canvas.forward + shift * (canvas.x + canvas.y)
    return "\n".join(
        [
            "camera {",
            "  perspective",
            f"  location {space.point(canvas.eye)}",
            f"  direction {space.point(direction)}",
            f"  right {space.point(canvas.width * canvas.pixel_size * canvas.x)}",
            f"  up {space.point(-canvas.height * canvas.pixel_size * canvas.y)}",
            "}",
        ]
    )
