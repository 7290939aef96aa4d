"""The documentation site is built without a warning, stands alone, and shows what it says it shows."""

from __future__ import annotations

import re
import subprocess
import sys
import textwrap
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag, urlsplit

import cv2
import numpy as np
import pytest

import tracer
from tracer.cli.app import cli

pytestmark = pytest.mark.slow

# Attributes that make a browser load something by itself; `a href` waits for a click.
LOADED = {
    "script": ("src",),
    "img": ("src", "srcset"),
    "source": ("src", "srcset"),
    "link": ("href",),
    "iframe": ("src",),
    "object": ("data",),
    "embed": ("src",),
    "video": ("src", "poster"),
    "audio": ("src",),
}
EXAMPLE = re.compile(r"^\.\. code-block:: python\n\n((?:   .*\n|\n)+)", re.MULTILINE)
IN_CSS = re.compile(r"""@import\s+["']([^"']+)|url\(\s*["']?([^"')]+)""")


class Page(HTMLParser):
    """What a page loads, what it links to, and the places in it that can be linked to."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.links: list[str] = []
        self.pictures: list[tuple[str, str]] = []
        self.places: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.loads += [given[name] for name in LOADED.get(tag, ()) if name in given]
        self.loads += [url for pair in IN_CSS.findall(given.get("style", "")) for url in pair if url]
        self.places |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        if tag == "img":
            self.pictures.append((given["src"], given.get("alt", "")))


@cache
def read(path: Path) -> Page:
    """A page, read once."""
    return Page(path)


@pytest.fixture(scope="module")
def site(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built from nothing as `make docs` builds it."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "-n", "--keep-going", "-d", str(folder / "trees")]
    done = subprocess.run(
        [*command, "docs", str(folder / "html")], cwd=repository, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stderr == ""
    return folder / "html"


def pages(site: Path) -> list[Path]:
    return sorted(site.rglob("*.html"))


def test_make_docs_builds_it_the_same_way(repository: Path) -> None:
    recipe = (
        (repository / "Makefile").read_text(encoding="utf-8").partition("\ndocs: ")[2].partition("\n\n")[0]
    )
    assert "-m sphinx -q -W -n --keep-going -d build/doctrees docs build/docs" in recipe


def test_nothing_is_loaded_from_elsewhere(site: Path) -> None:
    loads = [(page, url) for page in pages(site) for url in read(page).loads]
    sheets = sorted(site.rglob("*.css"))
    assert len(loads) > 100 and sheets
    for sheet in sheets:
        found = IN_CSS.findall(sheet.read_text(encoding="utf-8"))
        loads += [(sheet, url) for pair in found for url in pair if url]
    for page, url in loads:
        parts = urlsplit(url)
        assert parts.scheme in ("", "data") and not parts.netloc, f"{page.relative_to(site)} loads {url}"
        if not parts.scheme and parts.path and page.suffix == ".html":
            assert (page.parent / unquote(parts.path)).is_file(), f"{page.relative_to(site)}: no {url}"


def test_links_within_the_site_resolve(site: Path) -> None:
    broken, checked = [], 0
    for page in pages(site):
        for link in read(page).links:
            address, place = urldefrag(link)
            if urlsplit(address).scheme or urlsplit(address).netloc:
                continue
            checked += 1
            target = (page.parent / unquote(urlsplit(address).path)).resolve() if address else page
            exists = target.is_file() and target.is_relative_to(site.resolve())
            is_page = exists and target.suffix == ".html"
            if not exists or (place and is_page and unquote(place) not in read(target).places):
                broken.append(f"{page.relative_to(site)}: {link}")
    assert not broken
    assert checked > 1000


def test_each_step_of_the_tutorial_has_a_picture_of_its_own(site: Path) -> None:
    page = read(site / "tutorial.html")
    shown = [src for src, _ in page.pictures if "/tutorial-" in src or "/classic_" in src]
    pictures = [cv2.imread(str(site / unquote(src))) for src in shown]
    assert len(pictures) == 9 + 3  # the first step is dark
    for src, picture in zip(shown, pictures, strict=True):
        assert picture is not None, src
        assert picture.std() > 20, f"{src} is blank"
    for before, after in zip(pictures, pictures[1:], strict=False):
        assert np.abs(before.astype(int) - after.astype(int)).max() > 50, "two steps look the same"


def test_every_picture_of_the_tutorial_and_of_the_pixel_says_what_it_shows(site: Path) -> None:
    pictures = [entry for name in ("tutorial", "pixel") for entry in read(site / f"{name}.html").pictures]
    assert len(pictures) >= 12 + 1 + 4
    assert all(len(alt) > 20 for _, alt in pictures)


def test_the_pixel_adds_up_on_the_page(site: Path) -> None:
    """The numbers as a reader sees them: what each ray adds, the sum, and the rendered color."""
    text = (site / "pixel.html").read_text(encoding="utf-8")
    table = text.partition('class="docutils pixel-rays"')[2].partition("</table>")[0]
    rows = re.findall(r"<tr[ >].*?</tr>", table)
    last_cells = [re.sub(r"<[^>]+>", "", row.rpartition("<td>")[2]).split() for row in rows]
    colors = np.array([cell for cell in last_cells if len(cell) == 3], float)
    *added, total, rendered = colors
    assert 4 <= len(added) <= 12
    np.testing.assert_allclose(np.sum(added, axis=0), total, atol=0.0005 * (len(added) + 1))
    np.testing.assert_array_equal(total, rendered)


def test_the_examples_of_the_api_pages_run(
    repository: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    examples = [
        textwrap.dedent(code)
        for page in sorted(repository.glob("docs/api/*.rst"))
        for code in EXAMPLE.findall(page.read_text(encoding="utf-8"))
    ]
    assert len(examples) >= 3
    for example in examples:
        exec(compile(example, "an example", "exec"), {})
    assert capsys.readouterr().out.splitlines() == ["back wall", "[1200]"]
    assert tracer.load("ball.toml").to_dict()["shapes"][0]["kind"] == "sphere"


def test_every_command_is_described(site: Path) -> None:
    places = read(site / "commands.html").places
    assert {"tracer", *(f"tracer-{name}" for name in cli.commands)} <= places


def test_a_pixel_that_does_not_add_up_is_refused(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(repository / "docs")
    import tracer_docs.ray_tree

    monkeypatch.setattr(tracer_docs.ray_tree, "AGREEMENT", -1.0)
    with pytest.raises(ValueError, match=r"the tree of pixel \(\d+, \d+\) adds up to .*, tracer renders "):
        tracer_docs.ray_tree.story()
