"""How much memory a pass over a picture takes, before it starts, and how many rays at once fit in what is
allowed.

An estimate from above: the process as it is, the kernels still to come, the film and the copies of it that
are made when it is filtered and written, and one launch.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

from tracer.errors import MachineError, UsageError
from tracer.first_shadows import MOST_LIGHTS
from tracer.pixel_records import components_of, records_of, width_of
from tracer.scene import Scene
from tracer.settings import RAYS_PER_BAND
from tracer.tiles import FEWEST_PIXELS

KERNELS = 96 << 20
"""Bytes that compiling takes, and what Dr.Jit and NumPy set aside."""

UNKNOWN_PROCESS = 320 << 20
"""A process before its first ray, where the system does not say how large it is."""

FILTER_BYTES = 100
"""A pixel, of the depth-of-field filter: colors and depths in double precision, pixels sorted by depth."""

FIRST_TRIANGLE = 16
"""Bytes of a primary ray, of the search for its first triangle in bundles."""


LISTED_BYTES = 24
"""A pixel of a launch whose pixels come from a list: the list, on both sides."""

NOTED_BYTES = 10
"""A pixel of a picture: that it is to be refined."""


@dataclass(frozen=True)
class Need:
    """Bytes of a pass: `fixed`, and for each pixel and each primary ray of a launch."""

    fixed: int
    pixel: int
    ray: int

    def of(self, pixels: int, sub_rays: int) -> int:
        """All bytes, with so many pixels in a launch."""
        return self.fixed + pixels * (self.pixel + self.ray * sub_rays)


def need_of(
    scene: Scene, layers: list[str], pixels: int, real: int, triangles: bool, adaptive: bool = False
) -> Need:
    """What a pass over so many pixels takes; `real`: bytes of a number, 4 or 8. An adaptive picture has a
    film of refined pixels as well."""
    counts = components_of(layers, len(scene.lights))
    single = real == 4
    film = sum(width_of(record, counts, single) for record in records_of(counts, single)) * real
    written = sum(counts.values()) * 4 + 12
    filtered = FILTER_BYTES if scene.camera.depth_of_field is not None else 0
    refined, listed = (film + NOTED_BYTES, LISTED_BYTES) if adaptive else (0, 0)
    fixed = _process() + KERNELS + pixels * (film + refined + max(written, filtered))
    return Need(fixed, pixel=2 * film + 32 + listed, ray=_bundle_bytes(real) if triangles else 0)


def rays_that_fit(need: Need, sub_rays: int, limit: int | None, most: int = RAYS_PER_BAND) -> int:
    """Primary rays of a launch that stays within `limit` bytes, or within the machine's memory without one.

    Halves `most` until it fits, so that about the same limit gives the same bands. Raises `UsageError`, or
    `MachineError`, where not even the smallest launch does.
    """
    allowed = limit or _memory_of_machine()
    rays = most
    while allowed is not None and need.of(max(rays // sub_rays, FEWEST_PIXELS), sub_rays) > allowed:
        if rays // sub_rays <= FEWEST_PIXELS:
            least = in_words(need.of(FEWEST_PIXELS, sub_rays))
            if limit is None:
                raise MachineError(
                    f"memory: the picture takes about {least}, and this machine has {in_words(allowed)}; "
                    "a smaller --crop, --scale or fewer layers need less, --memory allows more all the same"
                )
            raise UsageError(
                f"memory: the picture takes about {least} at least, allowed are {in_words(limit)}; "
                "a smaller --crop, --scale or fewer layers need less"
            )
        rays //= 2
    return rays


def in_words(size: int) -> str:
    """`1.5 GiB`, `300 MiB`."""
    return f"{size / 2**30:.1f} GiB" if size >= 2**30 else f"{-(-size // 2**20)} MiB"


def _bundle_bytes(real: int) -> int:
    """The same, with the point there and what hides lights from it."""
    return FIRST_TRIANGLE + 4 + 3 * real + MOST_LIGHTS * (real + 4)


def _process() -> int:
    """Bytes of this process in memory."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, AttributeError):
        return UNKNOWN_PROCESS


def _memory_of_machine() -> int | None:
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, AttributeError):
        return None
