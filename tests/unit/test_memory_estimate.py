"""Launches are as large as memory allows, and no larger."""

from __future__ import annotations

import click
import pytest

import tracer
from tests.accuracy import worlds
from tracer import memory
from tracer.cli.options import Size
from tracer.errors import MachineError, UsageError
from tracer.memory import Need, in_words, need_of, rays_that_fit
from tracer.tiles import Band, after, bands

NEED = Need(fixed=1000, pixel=10, ray=2)


@pytest.mark.parametrize("sub_rays", [1, 4, 4096])
def test_the_largest_launch_that_fits(sub_rays: int) -> None:
    for limit in (NEED.of(128, sub_rays), NEED.of(1000, sub_rays), 10**9):
        rays = rays_that_fit(NEED, sub_rays, limit, most=1 << 20)
        assert NEED.of(max(128, rays // sub_rays), sub_rays) <= limit
        assert rays == 1 << 20 or NEED.of(2 * rays // sub_rays, sub_rays) > limit
    with pytest.raises(UsageError, match=r"takes about (. MiB) at least, allowed are \1"):
        rays_that_fit(NEED, sub_rays, NEED.of(128, sub_rays) - 1)


def test_without_a_limit_the_machine_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "_memory_of_machine", lambda: 900)
    with pytest.raises(MachineError, match="and this machine has 1 MiB"):
        rays_that_fit(NEED, 1, None)
    monkeypatch.setattr(memory, "_memory_of_machine", lambda: None)
    assert rays_that_fit(NEED, 1, None, most=77) == 77


def test_more_pixels_and_layers_need_more() -> None:
    scene = tracer.load(worlds.room())
    plain, layered = (need_of(scene, names, 10**6, 4, False) for names in ([], ["normal", "shape"]))
    assert layered.fixed - plain.fixed > 4 * 4 * 10**6
    assert layered.pixel > plain.pixel
    assert need_of(scene, [], 2 * 10**6, 4, False).fixed - plain.fixed > 24 * 10**6
    adaptive = need_of(scene, [], 10**6, 4, False, adaptive=True)
    assert adaptive.fixed - plain.fixed > 24 * 10**6 and adaptive.pixel > plain.pixel


@pytest.mark.parametrize(
    ("text", "size"), [("2G", 2 << 30), ("500M", 500 << 20), ("1.5GiB", 3 << 29), ("12", 12), ("7kb", 7168)]
)
def test_sizes(text: str, size: int) -> None:
    assert Size().convert(text, None, None) == size
    for wrong in (f"-{text}", f"{text}x", "", "G"):
        with pytest.raises(click.BadParameter, match="is no size"):
            Size().convert(wrong, None, None)


def test_words() -> None:
    assert [in_words(size) for size in (1, 3 << 20, 3 << 29)] == ["1 MiB", "3 MiB", "1.5 GiB"]


@pytest.mark.parametrize("rectangle", [(0, 0, 100, 50), (3, 5, 104, 47), (0, 0, 5, 90)])
@pytest.mark.parametrize("rays", [1, 600, 2048, 3000, 10**6])
def test_bands_cover_every_pixel_once_in_few_sizes(rectangle: tuple[int, int, int, int], rays: int) -> None:
    x0, y0, x1, y1 = rectangle
    cut = list(bands(rectangle, 4, rays))
    pixels = [(x, y) for b in cut for y in range(b.y0, b.y1) for x in range(b.x0, b.x1)]
    assert sorted(pixels) == [(x, y) for x in range(x0, x1) for y in range(y0, y1)]
    assert len({(band.width, band.height) for band in cut}) <= 4
    tiles = [-(-band.width // 8) * -(-band.height // 8) for band in cut]
    assert max(tiles) * 64 * 4 <= max(rays, 512), "no launch is larger than asked for, or than two tiles"


@pytest.mark.parametrize(("before", "then"), [(600, 600), (600, 5000), (5000, 600), (1, 10**6), (600, 1)])
def test_what_is_left_can_be_cut_otherwise(before: int, then: int) -> None:
    rectangle = (3, 5, 104, 47)

    def pixels(band: Band) -> set[tuple[int, int]]:
        return {(x, y) for x in range(band.x0, band.x1) for y in range(band.y0, band.y1)}

    everything = pixels(Band(*rectangle))
    first = list(bands(rectangle, 4, before))
    for done in range(1, len(first) + 1):
        covered = set().union(*map(pixels, first[:done]))
        rest = [band for part in after(rectangle, first[done - 1]) for band in bands(part, 4, then)]
        assert covered | set().union(*map(pixels, rest)) == everything
        assert len(covered) + sum(len(pixels(band)) for band in rest) == len(everything)
