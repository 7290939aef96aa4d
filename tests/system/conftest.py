"""A browser for the pages that commands write."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser, BrowserContext, Page, Route

BROWSERS = ("chromium", "chromium-browser", "google-chrome")


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """The system's browser; Playwright's own is never downloaded."""
    from playwright.sync_api import sync_playwright

    program = next((found for found in map(shutil.which, BROWSERS) if found), None)
    if program is None:
        pytest.skip(f"none of {', '.join(BROWSERS)} is on the path; scripts/install_browser.sh installs one")
    with sync_playwright() as playwright:
        # Its sandbox cannot start as root, as which tests run in containers.
        opened = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    """A window that says on closing whether the page asked for anything or complained."""
    found = browser.new_context(viewport={"width": 1400, "height": 900}, color_scheme="light")
    complaints: list[str] = []

    def only_files(route: Route) -> None:
        if route.request.url.startswith(("file:", "data:")):
            route.continue_()
        else:
            complaints.append(f"asked for {route.request.url}")
            route.abort()

    found.route("**/*", only_files)
    found.on("console", lambda message: complaints.append(f"{message.type}: {message.text}"))
    found.on("weberror", lambda error: complaints.append(str(error.error)))
    yield found
    found.close()
    assert not complaints


@pytest.fixture
def page(context: BrowserContext, file: Path) -> Page:
    """The page in the `file` of a test module, opened."""
    opened = context.new_page()
    opened.goto(file.as_uri())
    return opened
