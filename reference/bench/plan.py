"""What a run measures: the steps of the short and of the full set, each with about how long it takes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

from reference.bench import scenes
from reference.bench.builds import builds_of
from reference.bench.frames import Terms, measure
from reference.bench.queries import rates_of
from reference.bench.records import Build, Point, Rate
from reference.bench.scenes import MESHES, SCENES, Maker, Workshop
from tracer.errors import UsageError

TITLES = {
    "scenes": ("Scenes", "scene"),
    "pixels": ("The room, by size of the picture", "pixels across"),
    "triangles": ("The room with a mesh, by triangles", "triangles"),
    "lights": ("The room, by lights", "point lights"),
    "recursion": ("Mirrors all around, by depth", "reflections of every path"),
    "threads": ("The room, by threads", "threads"),
}
"""Groups of pictures: title and axis."""

PARTS = (*TITLES, "queries", "builds")
LARGEST_FOR_POVRAY = 2048
"""Pictures more pixels across would take it minutes."""

Result = Point | list[Rate] | list[Build]


@dataclass(frozen=True)
class Set:
    """A set of measurements. `pixels` across a picture of `scenes` and of curves; values on the axes;
    `meshes` of queries and builds; `repeat` rounds, `budget` seconds for each peer and picture."""

    scenes: tuple[str, ...]
    pixels: int
    curve_pixels: int
    sizes: tuple[int, ...]
    triangles: tuple[str, ...]
    lights: tuple[int, ...]
    depths: tuple[int, ...]
    meshes: tuple[str, ...]
    query_pixels: int
    repeat: int
    budget: float


QUICK = Set(
    scenes=("room", "room-82k"),
    pixels=512,
    curve_pixels=256,
    sizes=(256, 512, 1024),
    triangles=("3k", "82k"),
    lights=(1, 4, 16),
    depths=(1, 4, 16),
    meshes=("82k",),
    query_pixels=512,
    repeat=5,
    budget=3.0,
)
FULL = Set(
    scenes=tuple(SCENES),
    pixels=1024,
    curve_pixels=512,
    sizes=(256, 512, 1024, 2048, 4096, 8192),
    triangles=tuple(MESHES),
    lights=(1, 2, 4, 8, 16, 32, 64),
    depths=(1, 2, 4, 8, 16, 32, 64),
    meshes=("3k", "82k", "330k", "1.3M"),
    query_pixels=1024,
    repeat=9,
    budget=15.0,
)


@dataclass(frozen=True)
class Step:
    """One measurement: its `part`, a word for messages, about how many seconds it takes, and what it does."""

    part: str
    name: str
    weight: float
    run: Callable[[], Result]


def steps_of(chosen: Set, parts: Sequence[str], terms: Terms, workshop: Workshop) -> list[Step]:
    """The steps of the parts that are asked for, all if none is; raises `UsageError`, `SceneError`."""
    unknown = [part for part in parts if part not in PARTS]
    if unknown:
        raise UsageError(f'--only: "{unknown[0]}" is unknown; allowed: {", ".join(PARTS)}')
    wanted = parts or PARTS
    plan = _Plan(chosen, terms, workshop)
    return [step for part in PARTS if part in wanted for step in getattr(plan, part)()]


@dataclass(frozen=True)
class _Plan:
    """Makes the steps, part by part."""

    chosen: Set
    terms: Terms
    workshop: Workshop

    def scenes(self) -> Iterator[Step]:
        for name in self.chosen.scenes:
            maker = scenes.maker_of(name)
            yield self._picture("scenes", name, 0, maker, self.chosen.pixels, in_full=True)

    def pixels(self) -> Iterator[Step]:
        for size in self.chosen.sizes:
            peers = [peer for peer in self.terms.peers if peer != "povray" or size <= LARGEST_FOR_POVRAY]
            terms = replace(self.terms, peers=peers)
            yield self._picture("pixels", f"{size}²", size, scenes.room, size, terms)

    def triangles(self) -> Iterator[Step]:
        for size in self.chosen.triangles:
            count = 20 * MESHES[size] ** 2
            yield self._curve("triangles", size, count, partial(scenes.with_mesh, size=size))

    def lights(self) -> Iterator[Step]:
        for count in self.chosen.lights:
            yield self._curve("lights", str(count), count, partial(scenes.lights, count=count))

    def recursion(self) -> Iterator[Step]:
        for depth in self.chosen.depths:
            yield self._curve("recursion", str(depth), depth, partial(scenes.mirrors, depth=depth))

    def threads(self) -> Iterator[Step]:
        counts = [1]
        while 2 * counts[-1] <= self.terms.threads:
            counts.append(2 * counts[-1])
        for count in counts:
            terms = replace(self.terms, threads=count)
            yield self._picture("threads", str(count), count, scenes.room, self.chosen.pixels, terms)

    def queries(self) -> Iterator[Step]:
        for size in self.chosen.meshes:

            def run(size: str = size) -> Result:
                mesh, terms = scenes.mesh_alone(self.workshop, size), self.terms
                return rates_of(size, mesh, terms.peers, self.chosen.query_pixels, terms.repeat, terms.check)

            yield Step("queries", size, 8.0 + MESHES[size] ** 2 / 2000, run)

    def builds(self) -> Iterator[Step]:
        for size in self.chosen.meshes:

            def run(size: str = size) -> Result:
                mesh, file = scenes.mesh_alone(self.workshop, size), self.workshop.mesh(size)
                return builds_of(size, mesh, file, self.terms.peers, min(3, self.terms.repeat))

            yield Step("builds", size, 2.0 + MESHES[size] ** 2 / 1000, run)

    def _curve(self, part: str, name: str, x: float, maker: Maker) -> Step:
        return self._picture(part, name, x, maker, self.chosen.curve_pixels)

    def _picture(
        self,
        part: str,
        name: str,
        x: float,
        maker: Maker,
        pixels: int,
        terms: Terms | None = None,
        in_full: bool = False,
    ) -> Step:
        wanted = terms or self.terms

        def run() -> Result:
            return measure(name, x, maker(self.workshop, pixels), wanted, in_full)

        weight = (3.0 + min(wanted.budget, (pixels / 512) ** 2 * wanted.repeat)) * (2 if in_full else 1)
        return Step(part, name, weight, run)
