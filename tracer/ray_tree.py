"""One pixel under the lens: its tree of rays with every number that leads to its color.

The rays are traced level by level with the functions of the renderer. What each hit adds to the pixel is kept
by term, so that the contributions of all rays add up to the color that a render gives.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracer.color import encode_srgb

Triple = tuple[float, float, float]
BLACK: Triple = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class LightTerm:
    """What one light does at a hit: `facing` of its `samples` are on the lit side, `share` of them all
    arrives; D and H of the shading rule (its part of the weights and its color included); `hidden_by`: names
    of the shapes that hide samples, the nearest to the hit, with how many."""

    light: int
    kind: str
    samples: int
    facing: int
    share: float
    diffuse: Triple
    specular: Triple
    hidden_by: tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class HitPoint:
    """What a ray meets: the shape (its number, its name or kind), the triangle, the distance `t`, the point,
    the shading normal that faces the ray; whether the ray comes from outside; `color` C of the `texture`
    there (its name, empty for a shape of one color); k_a, m and h of the material."""

    shape: int
    name: str
    primitive: int
    t: float
    position: Triple
    normal: Triple
    entering: bool
    texture: str
    color: Triple
    absorption: float
    diffuse: float
    specular: float


@dataclass(frozen=True)
class EndedRay:
    """A child that is not traced: the `weight` it would have, and the `reason`: "cut off", "too deep" or
    "total reflection"."""

    kind: str
    weight: float
    reason: str


@dataclass
class RayNode:
    """A ray of the tree. `kind`: primary, reflected, refracted or total_reflection; `factor`: the k of the
    surface that it comes from; `weight`: the product of them on its way; `worth`: what its light counts in
    the pixel, by channel; `ambient`, `diffuse`, `specular`: what its hit adds to the pixel (a miss adds the
    background it sees as ambient light)."""

    kind: str
    level: int
    factor: float
    weight: float
    worth: Triple
    origin: Triple
    direction: Triple
    hit: HitPoint | None
    lights: tuple[LightTerm, ...] = ()
    ambient: Triple = BLACK
    diffuse: Triple = BLACK
    specular: Triple = BLACK
    ended: tuple[EndedRay, ...] = ()
    children: list[RayNode] = field(default_factory=list)

    @property
    def contribution(self) -> NDArray[np.float64]:
        """(3,) what the pixel would lack without this hit's own light."""
        return np.sum([self.ambient, self.diffuse, self.specular], axis=0)

    def walk(self) -> Iterator[RayNode]:
        """This ray and all below it, parents first."""
        yield self
        for child in self.children:
            yield from child.walk()


@dataclass(frozen=True)
class PixelTree:
    """The trees of a pixel, one for each of its n x n sub-rays, in the order in which they are traced."""

    scene_name: str
    x: int
    y: int
    supersample: int
    linear: bool
    precision: str
    sub_rays: tuple[RayNode, ...]

    def rays(self) -> Iterator[RayNode]:
        """All rays of the pixel."""
        for root in self.sub_rays:
            yield from root.walk()

    @property
    def color(self) -> NDArray[np.float64]:
        """(3,) the sum of all contributions, display-referred, before depth of field: the rendered pixel."""
        total = np.sum([ray.contribution for ray in self.rays()], axis=0)
        return np.asarray(encode_srgb(total) if self.linear else total)

    def to_dict(self) -> dict[str, Any]:
        """The tree as numbers, texts, lists and dicts, for JSON; a ray that misses has `hit` None."""
        return asdict(self) | {"color": self.color.tolist()}
