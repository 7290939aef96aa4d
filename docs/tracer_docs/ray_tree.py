"""One pixel of the classic room, explained: its tree of rays and what every ray adds to the color.

The tree is that of `reference.plain`; the color it adds up to is held against what `tracer` renders.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import tracer
from reference import plain
from reference.plain import BLACK, WHITE, Node, Vec, componentwise
from tracer.assets import ASSETS

AGREEMENT = 1e-9  # of display values, in double precision
LARGEST_TREE = 12  # rays; more do not fit on a page
GRID = 16  # only every sixteenth pixel in both directions is a candidate


@dataclass(frozen=True)
class Share:
    """A secondary ray that is not traced: `factor` k of its surface, `weight` it would have, and why not."""

    kind: str
    factor: float
    weight: float
    reason: str


@dataclass(frozen=True)
class TracedRay:
    """One ray of the tree. `worth` is what its light is worth in the pixel, channel by channel; `ambient`,
    `diffuse` and `specular` are what its own hit adds to the pixel (a miss adds `ambient` alone)."""

    number: int
    parent: int | None
    node: Node
    shape: plain.Shape | None
    worth: Vec
    ambient: Vec
    diffuse: Vec
    specular: Vec
    ended: tuple[Share, ...]

    @property
    def name(self) -> str:
        """The shape that is hit."""
        return self.shape.name if self.shape else "nothing"

    @property
    def contribution(self) -> Vec:
        """What the pixel would lack without this hit's own light."""
        return self.ambient + self.diffuse + self.specular


@dataclass(frozen=True)
class Story:
    """A pixel with its tree; `rendered` is the color that `tracer` gives in double precision."""

    scene: tracer.Scene
    world: plain.World
    column: int
    row: int
    rays: tuple[TracedRay, ...]
    rendered: Vec

    @property
    def color(self) -> Vec:
        """The sum of all contributions."""
        return sum((ray.contribution for ray in self.rays), BLACK)

    @property
    def disagreement(self) -> float:
        """The largest difference of the sum from the tree's own color and from the rendered one."""
        return plain.largest(self.color - self.rendered, self.color - self.rays[0].node.color)

    def children(self, ray: TracedRay) -> list[TracedRay]:
        """The rays that start where this one ends."""
        return [other for other in self.rays if other.parent == ray.number]


@cache
def story() -> Story:
    """The pixel on the first transparent shape whose tree, of at most `LARGEST_TREE` rays, meets most shapes.

    ValueError where the sum of the tree is not the pixel.
    """
    scene = tracer.load("classic")
    world = plain.load(scene.to_dict(), ASSETS.parent)
    column, row, tree = _most_telling(scene, world)
    box = (column, row, column + 1, row + 1)
    picture = tracer.render(scene, precision="double", supersample=1, crop=box)
    rays = tuple(_rays(world, tree))
    found = Story(scene, world, column, row, rays, plain.vec(picture.color[0, 0]))
    if world.linear or found.disagreement > AGREEMENT:
        raise ValueError(
            f"the tree of pixel ({column}, {row}) adds up to {found.color}, tracer renders {found.rendered}"
        )
    return found


def _most_telling(scene: tracer.Scene, world: plain.World) -> tuple[int, int, Node]:
    glass = next(k for k, shape in enumerate(world.shapes) if shape.material.refraction > 0)
    small = tracer.render(scene, supersample=1, scale=1 / GRID, aovs=("shape",))
    best: tuple[tuple[int, int], tuple[int, int, Node]] | None = None
    for y, x in zip(*(small.aovs["shape"] == glass).nonzero(), strict=True):
        column, row = int(x) * GRID + GRID // 2, int(y) * GRID + GRID // 2
        tree = plain.ray_tree(world, column, row, n=1)
        nodes = list(_all(tree))
        if tree.shape == glass and len(nodes) <= LARGEST_TREE:
            merit = (len({node.shape for node in nodes}), len(nodes))
            if best is None or merit > best[0]:
                best = merit, (column, row, tree)
    if best is None:
        raise ValueError("no pixel of the classic room has a tree that fits on a page")
    return best[1]


def _all(node: Node) -> Iterator[Node]:
    yield node
    for child in node.children:
        yield from _all(child)


def _rays(world: plain.World, tree: Node) -> Iterator[TracedRay]:
    """Numbered from 1, parents before children, the mirrored side first."""
    waiting: list[tuple[Node, int | None, Vec]] = [(tree, None, WHITE)]
    number = 0
    while waiting:
        node, parent, worth = waiting.pop(0)
        number += 1
        yield _traced(world, node, number, parent, worth)
        if node.children:
            passed = (1 - world.ambient) * componentwise(worth, node.surface_color)
            waiting += [(child, number, child.factor * passed) for child in node.children]


def _traced(world: plain.World, node: Node, number: int, parent: int | None, worth: Vec) -> TracedRay:
    if node.shape < 0:
        return TracedRay(
            number, parent, node, None, worth, componentwise(worth, node.color), BLACK, BLACK, ()
        )
    shape, a = world.shapes[node.shape], world.ambient
    material = shape.material
    lit = componentwise(worth, node.surface_color)
    direct = (1 - a) * material.absorption * lit
    return TracedRay(
        number,
        parent,
        node,
        shape,
        worth,
        ambient=a * lit,
        diffuse=material.diffuse * componentwise(direct, node.diffuse_light),
        specular=material.specular * componentwise(direct, node.specular_light),
        ended=tuple(_ended(world, node, material)),
    )


def _ended(world: plain.World, node: Node, material: plain.Material) -> Iterator[Share]:
    kinds = [child.kind for child in node.children]
    for kind, factor in (("reflected", material.reflection), ("refracted", material.refraction)):
        if factor == 0 or kind in kinds or (kind == "refracted" and "total_reflection" in kinds):
            continue
        weight = node.weight * factor
        if weight <= world.cutoff - 1e-6:
            reason = "cut off"
        else:
            reason = "too deep" if node.level == world.max_depth else "total reflection"
        yield Share(kind, factor, weight, reason)
