"""`tracer render SCENE --pixel X Y`: the tree of rays of one pixel, as text or as JSON."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import click

from tracer.cli.failures import report
from tracer.errors import TracerError, UsageError

if TYPE_CHECKING:
    from tracer.cli.wishes import Wishes
    from tracer.ray_tree import EndedRay, HitPoint, LightTerm, PixelTree, RayNode


def show_pixels(sources: Sequence[str], pixel: tuple[int, int], wishes: Wishes, as_json: bool = False) -> int:
    """Prints the tree of the pixel in each scene, and returns the worst exit code; `as_json`: a line each."""
    from tracer.lens import pixel_tree
    from tracer.scene import load

    if wishes.outputs:
        raise UsageError("--pixel: writes no picture; leave out either --pixel or -o")
    if wishes.threshold is not None:
        raise UsageError("--pixel: a pixel shows all its sub-rays; leave out --threshold")
    names = ("scale", "resolution", "supersample", "precision", "backend", "seed")
    settings = {name: getattr(wishes, name) for name in names}
    worst = 0
    for source in sources:
        try:
            scene = load(source, allow_outside=wishes.allow_outside, overrides=wishes.overrides)
            tree = pixel_tree(scene, *pixel, **settings)
        except TracerError as error:
            worst = max(worst, report(error))
            continue
        if as_json:
            click.echo(json.dumps(tree.to_dict()))
            continue
        click.echo("\n".join(lines_of(tree)))
        lens = scene.camera.depth_of_field
        if lens is not None and lens.focus > 0:
            click.echo("The picture's depth of field mixes this color with those of neighbors.")
    return worst


def lines_of(tree: PixelTree) -> Iterator[str]:
    """The tree as text: children are indented, and the last line is the sum of all that rays add."""
    count = len(tree.sub_rays)
    yield (
        f"pixel {tree.x} {tree.y} of {tree.scene_name}: {count} sub-ray{'s' * (count > 1)}, "
        f"{tree.precision} precision"
    )
    for number, root in enumerate(tree.sub_rays):
        if count > 1:
            yield f"sub-ray {number}"
        yield from _ray(root, "  ")
    yield f"sum of {sum(1 for _ in tree.rays())} rays: {_numbers(tree.color)}"


def _ray(ray: RayNode, indent: str) -> Iterator[str]:
    hit = ray.hit
    where = "nothing" if hit is None else f"{hit.name}, primitive {hit.primitive}, at distance {hit.t:.6g}"
    yield f"{indent}{ray.kind.replace('_', ' ')} ray, weight {ray.weight:.4g}: {where}"
    inner = indent + "  "
    if hit is None:
        yield f"{inner}adds the background {_numbers(ray.ambient)}"
        return
    yield from (inner + line for line in _about(hit))
    yield from (inner + _light(light) for light in ray.lights)
    yield (
        f"{inner}adds ambient {_numbers(ray.ambient)} + diffuse {_numbers(ray.diffuse)} "
        f"+ specular {_numbers(ray.specular)} = {_numbers(ray.contribution)}"
    )
    yield from (inner + _ended(child) for child in ray.ended)
    for child in ray.children:
        yield from _ray(child, inner)


def _about(hit: HitPoint) -> Iterator[str]:
    side = "outside" if hit.entering else "inside"
    yield f"point {_numbers(hit.position)}, normal {_numbers(hit.normal)}, seen from {side}"
    texture = f" of texture {hit.texture}" if hit.texture else ""
    yield (
        f"color {_numbers(hit.color)}{texture}; k_a {hit.absorption:.4g}, m {hit.diffuse:.4g}, "
        f"h {hit.specular:.4g}"
    )


def _light(light: LightTerm) -> str:
    name = f"light {light.light} ({light.kind})"
    if light.facing == 0:
        return f"{name}: behind the surface"
    hidden = ", ".join(
        shape if light.samples == 1 else f"{shape} ({number} of {light.samples})"
        for shape, number in light.hidden_by
    )
    seen = "hidden" if light.share == 0 else f"{light.share:.4g} arrives" if light.share < 1 else "visible"
    by = f" by {hidden}" if light.share == 0 and hidden else f", hidden by {hidden}" if hidden else ""
    return f"{name}: {seen}{by}; D {_numbers(light.diffuse)}, H {_numbers(light.specular)}"


def _ended(child: EndedRay) -> str:
    return f"{child.kind.replace('_', ' ')} ray would weigh {child.weight:.4g}: {child.reason}"


def _numbers(values: Iterable[float]) -> str:
    return f"({' '.join(f'{value:.6g}' for value in values)})"
