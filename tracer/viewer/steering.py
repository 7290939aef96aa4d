"""How a user steers the camera: around what was grabbed, along the canvas, and as the document moves it."""

from __future__ import annotations

from collections.abc import Callable

from tracer.camera import Camera
from tracer.viewer import camera as moves


class Steering:
    """Base of what has a camera. A `gesture` is undone as one; `stamp` comes back with the first picture."""

    def __init__(self, camera: Camera) -> None:
        self._pivot = moves.pivot_of(camera, -1.0)

    @property
    def camera(self) -> Camera:
        """The camera as it stands."""
        raise NotImplementedError

    def move(self, change: Callable[[Camera], Camera], gesture: object = None, stamp: float = 0.0) -> None:
        """Changes the camera; raises `SceneError` where that leads nowhere."""
        raise NotImplementedError

    def grab(self, depth: float) -> None:
        """Says what the camera goes around from now on: what the middle of the picture shows, `depth` from
        the canvas (-1: nothing)."""
        self._pivot = moves.pivot_of(self.camera, depth)

    def orbit(self, left: float, up: float, gesture: object = None, stamp: float = 0.0) -> None:
        """Goes around what was grabbed, in degrees."""
        self.move(lambda camera: moves.orbited(camera, self._pivot, left, up), gesture, stamp)

    def pan(self, right: float, down: float, gesture: object = None, stamp: float = 0.0) -> None:
        """Moves what was grabbed by shares of the picture's height."""
        self.move(lambda camera: moves.panned(camera, self._pivot, right, down), gesture, stamp)

    def dolly(self, share: float, gesture: object = None, stamp: float = 0.0) -> None:
        """Goes a share of the way to what was grabbed."""
        self.move(lambda camera: moves.dollied(camera, self._pivot, share), gesture, stamp)

    def rotate(self, x: float, y: float, gesture: object = None, stamp: float = 0.0) -> None:
        """The document's x_rotate and y_rotate."""
        self.move(lambda camera: moves.rotated(camera, x, y), gesture, stamp)

    def shift(self, by: tuple[float, float, float], gesture: object = None, stamp: float = 0.0) -> None:
        """The document's move."""
        self.move(lambda camera: moves.shifted(camera, by), gesture, stamp)
