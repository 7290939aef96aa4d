"""The page of `tracer bench` in a browser: it loads nothing, and can be read at every width."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import pytest

from reference.bench.plan import TITLES
from reference.bench.rays import KINDS
from reference.bench.records import PEERS, Benchmark, Build, Frame, Group, Point, Process, Rate, Series
from reference.bench.report import page_of

if TYPE_CHECKING:
    from playwright.sync_api import BrowserContext, Locator, Page

pytestmark = pytest.mark.slow

COMMAND = "tracer bench --full --summary reports/benchmark.md"
MESHES = {"82k": 81_920, "1.3M": 1_310_720}
NOTHING = float("nan")


def series(seconds: float) -> Series:
    return Series((1.1 * seconds, seconds, 1.2 * seconds))


def point(name: str, x: float, seconds: float) -> Point:
    """One picture by all."""
    rays = {"primary": 1_048_576, "shadow": 6_912_345, "total_reflection": 12_345}
    factors = {"tracer": 1.0, "mitsuba": 1.4, "povray": 32.0}
    frames = tuple(
        Frame(peer, series(factor * seconds), series(2 * factor * seconds), rays, 0.0123)
        for peer, factor in factors.items()
    )
    processes = tuple(Process(peer, 0.9, 0.2, 0.1, 1.7, NOTHING, 180.0) for peer in factors)
    return Point(name, x, 1_048_576, frames, processes)


def whole_run() -> Benchmark:
    """With everything that a page shows."""
    groups = tuple(
        Group(name, *TITLES[name], tuple(point(f"{name}-{k}", 2.0**k, 0.03 * 2**k) for k in range(5)))
        for name in TITLES
    )
    rates = tuple(
        Rate(mesh, kind, peer, 1_000_000, 700_000, series(0.05 * (1 + k)))
        for mesh in MESHES
        for kind in KINDS
        for k, peer in enumerate(("tracer", "mitsuba"))
    )
    builds = tuple(
        Build(mesh, count, peer, series(0.1), series(0.2))
        for mesh, count in MESHES.items()
        for peer in ("tracer", "mitsuba")
    )
    facts = {"processor": "A processor with a long name, 2 cores", "command to repeat": COMMAND}
    return Benchmark(facts, groups, rates, builds, ["POV-Ray is not installed."])


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a whole run."""
    path = tmp_path_factory.mktemp("bench") / "index.html"
    path.write_text(page_of(whole_run()), encoding="utf-8")
    return path


def rows_of(table: Locator) -> list[list[str]]:
    """The texts of the cells."""
    return [row.locator("th, td").all_inner_texts() for row in table.locator("tbody tr").all()]


def test_all_parts_are_reached_from_the_top(page: Page) -> None:
    links = page.locator("nav a").all()
    assert len(links) == len(TITLES) + 3
    for link in links:
        link.click()
        place = str(link.get_attribute("href"))
        assert page.locator(place).is_visible() and page.evaluate("location.hash") == place


def test_every_drawing_is_there(page: Page) -> None:
    """Bars of each other renderer, a curve of times and one of ratios a group, bars a mesh."""
    drawings = page.locator(".plot svg").all()
    assert len(drawings) == len(PEERS) - 1 + 2 * (len(TITLES) - 1) + len(MESHES)
    for drawing in drawings:
        box = drawing.bounding_box()
        assert box is not None and box["width"] > 300 and box["height"] > 100
        assert drawing.locator("path").count() > 5 and drawing.locator("text").count() > 4
    labels = [str(drawing.get_attribute("aria-label")) for drawing in drawings]
    assert len(set(labels)) == len(labels) and all(labels)


def test_tables_say_the_numbers(page: Page) -> None:
    scenes = rows_of(page.locator("#scenes table").first)
    assert scenes[1][:5] == ["", "Mitsuba 3", "46.2 ms 42.0 ms", "1.40", "1.40"]
    rays = rows_of(page.locator("#scenes table").nth(1))
    assert rays[0] == ["scenes-0", "tracer", "1,048,576", "6,912,345", "12,345"]
    first = rows_of(page.locator("#scenes table").nth(2))
    assert first[0][2:] == ["900 ms", "200 ms", "100 ms", "1.70 s", "–", "180 MiB"]
    rates = rows_of(page.locator("#queries table").first)
    assert len(rates) == len(KINDS) * len(MESHES)
    assert rates[0][:5] == ["82k", KINDS[0], "18.2", "9.09", "2.00"] and rates[1][0] == ""
    costs = page.locator("#queries table").nth(1)
    assert rows_of(costs)[1] == ["primary, tile order", "1.00 ×", "1.00 ×"]
    assert [row[0] for row in rows_of(page.locator("#builds table"))] == ["81,920", "", "1,310,720", ""]


@pytest.mark.parametrize("width, look", [(1400, "light"), (1400, "dark"), (390, "light")])
def test_it_can_be_read_at_every_width(page: Page, tmp_path: Path, width: int, look: str) -> None:
    """Nothing runs over the window but tables in frames of their own that scroll; letters of drawings stay
    large enough."""
    page.emulate_media(color_scheme=look)  # type: ignore[arg-type]
    page.set_viewport_size({"width": width, "height": 900})
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert max(page.locator("tbody tr").evaluate_all("(all) => all.map((row) => row.offsetHeight)")) < 60
    heights = "(all) => all.map((letters) => letters.getBoundingClientRect().height)"
    assert min(page.locator(".plot text").evaluate_all(heights)) > 8
    for name in ("header", "#scenes .drawings", "#pixels .drawings", "#queries .drawings", "#builds table"):
        target = page.locator(name).first
        target.scroll_into_view_if_needed()
        target.screenshot(path=tmp_path / "shot.png")
        shot = cv2.imread(str(tmp_path / "shot.png"), cv2.IMREAD_GRAYSCALE)
        assert shot is not None and shot.std() > 5, name


def test_a_drawing_is_drawn_in_the_colors_of_the_look(page: Page) -> None:
    """The curve of tracer has the color of its swatch, in both looks."""
    for look in ("light", "dark"):
        page.emulate_media(color_scheme=look)  # type: ignore[arg-type]
        swatch = page.locator(".swatch.tracer").first.evaluate(
            "(key) => getComputedStyle(key).backgroundColor"
        )
        curves = page.locator("#pixels .plot path")
        assert swatch in curves.evaluate_all("(all) => all.map((curve) => getComputedStyle(curve).stroke)")


def test_the_command_is_copied(context: BrowserContext, page: Page) -> None:
    context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.locator("header .copy").click()
    page.wait_for_function("document.querySelector('header .copy').textContent === 'Copied'")
    assert page.evaluate("navigator.clipboard.readText()") == COMMAND
