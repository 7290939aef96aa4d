"""The page of the report in a browser: nothing is loaded or logged, and what moves does."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import pytest

from reference.report import write_report
from tests.outcomes import COMMAND, failing_run

if TYPE_CHECKING:
    from playwright.sync_api import Browser, BrowserContext, Page

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a run with a failure."""
    path = tmp_path_factory.mktemp("report") / "index.html"
    write_report(path, failing_run())
    return path


def test_a_picture_is_swapped_under_the_mouse_and_kept_by_a_press(page: Page) -> None:
    ours, theirs = page.locator("details[open] .trio").first.locator(".swap").all()
    sources = [button.locator("img").get_attribute("src") for button in (ours, theirs)]
    assert sources[0] != sources[1]
    image = ours.locator("img")
    ours.hover()
    assert image.get_attribute("src") == sources[1] and ours.inner_text() == "Mitsuba"
    page.mouse.move(0, 0)
    assert image.get_attribute("src") == sources[0] and ours.inner_text() == "ours"
    ours.click()
    page.mouse.move(0, 0)
    assert image.get_attribute("src") == sources[1] and ours.get_attribute("aria-pressed") == "true"
    assert theirs.locator("img").get_attribute("src") == sources[1]


def test_a_picture_is_swapped_with_the_keyboard(page: Page) -> None:
    ours, theirs = page.locator("details[open] .trio").first.locator(".swap").all()
    image, source = ours.locator("img"), ours.locator("img").get_attribute("src")
    theirs.focus()
    page.keyboard.press("Shift+Tab")
    assert image.get_attribute("src") != source
    page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    assert image.get_attribute("src") != source and ours.get_attribute("aria-pressed") == "true"
    page.keyboard.press("Shift+Tab")
    page.keyboard.press("Space")
    page.keyboard.press("Tab")
    assert image.get_attribute("src") == source and ours.get_attribute("aria-pressed") == "false"


def test_a_picture_is_swapped_by_a_tap_and_back_by_another(browser: Browser, file: Path) -> None:
    page = browser.new_page(has_touch=True, viewport={"width": 400, "height": 800})
    page.goto(file.as_uri())
    ours = page.locator("details[open] .trio .swap").first
    image, source = ours.locator("img"), ours.locator("img").get_attribute("src")
    ours.tap()
    assert image.get_attribute("src") != source
    ours.tap()
    assert image.get_attribute("src") == source
    page.close()


def test_a_command_is_copied(context: BrowserContext, page: Page) -> None:
    context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.locator("header .copy").click()
    page.wait_for_function("document.querySelector('header .copy').textContent === 'Copied'")
    assert page.evaluate("navigator.clipboard.readText()") == COMMAND


def test_the_look_follows_the_system_until_the_button_says_otherwise(page: Page) -> None:
    def paper() -> str:
        return str(page.evaluate("getComputedStyle(document.body).backgroundColor"))

    light = paper()
    page.emulate_media(color_scheme="dark")
    dark = paper()
    assert dark != light
    assert page.locator("#theme").get_attribute("aria-pressed") == "true"
    page.locator("#theme").click()
    assert paper() == light
    page.locator("#theme").click()
    assert paper() == dark
    ink = page.evaluate("getComputedStyle(document.querySelector('.plot svg text')).fill")
    assert ink == page.evaluate("getComputedStyle(document.querySelector('.scene .brief')).color")


def test_failures_are_listed_first_and_their_scene_is_open(page: Page) -> None:
    page.locator("#all > summary").click()
    first = page.locator("#rows tr").first
    assert first.inner_text().split("\t")[:3] == ["failed", "hits", "other"]
    assert page.locator("#terms tbody tr").first.inner_text().startswith("1 failed\thits")
    assert page.locator("details.scene[open] .name").all_inner_texts() == ["other"]


def test_rows_are_filtered_by_words(page: Page) -> None:
    page.locator("#all > summary").click()
    page.locator("#filter").fill("Distance double")
    rows = page.locator("#rows tr:visible")
    assert rows.count() == 1 and "double" in rows.inner_text()
    assert page.locator("#shown").inner_text() == "1 of 10"
    page.locator("#filter").fill("")
    assert page.locator("#rows tr:visible").count() == 10
    page.locator("details.scene[open] .filter-link").click()
    assert page.locator("#rows tr:visible").count() == 3


def test_a_square_of_the_matrix_opens_its_scene(page: Page) -> None:
    closed = page.locator("#scene-1")
    assert closed.get_attribute("open") is None
    page.locator("#matrix tbody tr").first.locator("td a").first.click()
    page.wait_for_function("document.getElementById('scene-1').open")
    assert closed.locator(".plot svg").first.is_visible()


@pytest.mark.parametrize("width, look", [(1400, "light"), (1400, "dark"), (400, "light")])
def test_it_shows_something_at_every_width_and_never_runs_over(
    page: Page, tmp_path: Path, width: int, look: str
) -> None:
    page.emulate_media(color_scheme=look)  # type: ignore[arg-type]
    page.set_viewport_size({"width": width, "height": 900})
    page.locator("#unfold").click()
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    for name in ("header", "#matrix", "#scene-1 .trio", "#scene-1 .plots"):
        target = page.locator(name).first
        target.scroll_into_view_if_needed()
        target.screenshot(path=tmp_path / "shot.png")
        shot = cv2.imread(str(tmp_path / "shot.png"), cv2.IMREAD_GRAYSCALE)
        assert shot is not None and shot.std() > 5, name
    loaded = "[...document.querySelectorAll('#scene-1 img')].map((image) => image.decode())"
    assert page.evaluate(f"Promise.all({loaded}).then((all) => all.length)") == 7
