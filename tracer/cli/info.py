"""`tracer info`: what is in a scene."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import click

from tracer.cli.options import scene_options

if TYPE_CHECKING:
    from tracer.scene import Scene


@click.command(short_help="Tell what is in a scene.")
@click.argument("scene")
@scene_options
def info(scene: str, overrides: tuple[str, ...], allow_outside: bool) -> None:
    """Tell what is in SCENE, a .toml file or a built-in name: shapes, lights, camera, memory, warnings.

    \b
    Examples:
      tracer info room
      tracer info my.toml --set camera.fov=30
    """
    from tracer.scene import find_scene, load

    loaded = load(scene, allow_outside=allow_outside, overrides=overrides)
    for name, value in describe(loaded, str(find_scene(scene)[0])):
        click.echo(f"{name:<12}{value}")


def describe(scene: Scene, file: str) -> list[tuple[str, str]]:
    """Names and values of the report; raises `SceneError` where a mesh or a picture cannot be used."""
    from tracer.scene_warnings import finite_extents, warnings_of

    extents = finite_extents(scene)
    triangles = sum(len(points) // 3 for points, radius in extents.values() if radius == 0)
    samples = sum(getattr(light, "samples", 1) for light in scene.lights)
    rows = [
        ("scene", f"{scene.name} ({file})"),
        ("shapes", _counted(shape.kind for shape in scene.shapes)),
        ("triangles", str(triangles)),
        ("bounds", _bounds(extents)),
        ("lights", _counted(light.kind for light in scene.lights) + f"; {samples} samples in all"),
        ("textures", _counted(texture.kind for texture in scene.textures.values())),
        ("materials", str(len(scene.materials))),
        *_camera(scene),
        ("memory", _memory(scene)),
    ]
    return rows + [("warning", warning) for warning in warnings_of(scene)]


def _counted(kinds: Iterable[str]) -> str:
    """The number in all and by kind, such as `9: 4 plane, 5 sphere`."""
    by_kind = Counter(kinds)
    parts = ", ".join(f"{count} {kind}" for kind, count in sorted(by_kind.items()))
    return f"{by_kind.total()}: {parts}" if parts else "0"


def _bounds(extents: dict[int, Any]) -> str:
    """The box around spheres and meshes; planes have no end."""
    import numpy as np

    if not extents:
        return "none (no sphere, no mesh)"
    low = np.min([points.min(axis=0) - radius for points, radius in extents.values()], axis=0)
    high = np.max([points.max(axis=0) + radius for points, radius in extents.values()], axis=0)
    sides = (f"{axis} {a:g} to {b:g}" for axis, a, b in zip("xyz", low, high, strict=True))
    return f"{', '.join(sides)} (without planes)"


def _camera(scene: Scene) -> list[tuple[str, str]]:
    import numpy as np

    from tracer.canvas import Canvas

    canvas, camera = Canvas.of(scene.camera, scene.literal), scene.camera
    fov = 2 * np.degrees(np.arctan(canvas.height * canvas.pixel_size / 2 / canvas.distance))
    rays = camera.supersample**2
    focus = camera.depth_of_field
    sharp = "" if focus is None or focus.focus < 0 else f", sharp at {focus.focus:g}"
    return [
        (
            "camera",
            f"{canvas.width} x {canvas.height} pixels, {rays} ray{'s' if rays > 1 else ''} each{sharp}",
        ),
        ("  eye", f"{_point(canvas.eye)}, looking along {_point(canvas.forward)}"),
        ("  canvas", f"center {_point(canvas.center)}, {canvas.distance:g} from the eye"),
        ("  view", f"{fov:.4g} degrees from top to bottom"),
    ]


def _point(point: Any) -> str:
    return f"({', '.join(f'{float(c):.6g}' for c in point)})"


def _memory(scene: Scene) -> str:
    """What the scene's tables take in single precision, counted on the compiled scene."""
    from tracer.backends import find_backend
    from tracer.cache import bytes_of
    from tracer.device_scene import compile_scene
    from tracer.errors import MachineError
    from tracer.replay import take_apart

    try:
        backend = find_backend()
    except MachineError as error:
        return f"unknown: {error}"
    tables: list[Any] = []
    take_apart(compile_scene(scene, backend), tables)
    return f"{bytes_of(tables) / 2**20:.3g} MiB of tables in single precision"
