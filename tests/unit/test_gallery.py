"""The gallery: complete, up to date, self-contained and small; and the program that makes it."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import cv2
import numpy as np
import pytest

import tracer
from scripts.gallery.__main__ import FINGERPRINTS, PAGES, make_gallery
from scripts.gallery.depth import GRAYS, DepthScale, colors_of_the_bar, paint
from scripts.gallery.entries import DOCUMENT, GROUPS, OTHERS, Entry, entries, fingerprint, read_entry
from scripts.gallery.pages import Exhibit, index_page, scenes_page
from scripts.gallery.thumbnails import thumbnail, thumbnail_size
from tracer.assets import builtin_scenes

STALE = "docs/gallery does not show the scenes as they are: run `make gallery`"
LARGEST_TOTAL = 1_500_000  # bytes of all thumbnails
NAMES = list(builtin_scenes())
LINK = re.compile(r"\]\(([^)\s]+)\)")

SMALL_SCENE = """\
# A ball with <angle> brackets & [square] ones.

[camera]
resolution = [24, 18]
origin = [0, 0, 5]
target = [0, 0, 0]
fov = 40.0

[[lights]]
kind = "point"
position = [3, 4, 5]

[textures.picture]
kind = "image"
file = "picture.png"

[[shapes]]
kind = "sphere"
center = [0, 0, 0]
radius = 1
texture = "picture"
"""


class Page(HTMLParser):
    """What an HTML page shows, and where it leads."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.links: list[str] = []
        self.pictures: dict[str, dict[str, str]] = {}  # attributes by source
        self.scene_texts: list[str] = []
        self._inside_text = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        attributes = {key: value or "" for key, value in attrs}
        self.ids += [attributes["id"]] if "id" in attributes else []
        self.links += [attributes["href"]] if "href" in attributes else []
        if tag == "img":
            self.pictures[attributes["src"]] = attributes
        if tag == "pre":
            self._inside_text = True
            self.scene_texts.append("")

    def handle_endtag(self, tag: str) -> None:
        self._inside_text &= tag != "pre"

    def handle_data(self, data: str) -> None:
        if self._inside_text:
            self.scene_texts[-1] += data


def committed(name: str) -> str:
    """The text of a page as it is committed."""
    return (PAGES / name).read_text(encoding="utf-8")


def recorded() -> dict[str, str]:
    """The fingerprint of every scene as it was rendered."""
    return json.loads(committed(FINGERPRINTS))


# ---- What is committed ----


@pytest.mark.parametrize("name", NAMES)
def test_every_scene_is_shown_as_it_is(name: str) -> None:
    assert recorded().get(name) == fingerprint(tracer.load(name)), STALE


def test_no_other_scene_is_shown() -> None:
    files = {file.name for file in PAGES.glob("*.webp")}
    assert set(recorded()) == set(NAMES), STALE
    assert files == {f"{name}{suffix}" for name in NAMES for suffix in (".webp", ".depth.webp")}, STALE


def test_texts_and_captions_are_those_of_the_scene_files() -> None:
    found = entries()
    assert Page(committed("scenes.html")).scene_texts == [entry.text for entry in found], STALE
    overview = committed("index.md")
    assert [entry.name for entry in found if entry.caption not in overview] == [], STALE


@pytest.mark.parametrize("name", NAMES)
def test_thumbnails_have_the_shape_of_the_scene(name: str) -> None:
    """Both, and on the page an alternative text and the size, so that nothing jumps while it loads."""
    width, height = tracer.load(name).camera.resolution
    expected = thumbnail_size(np.empty((height, width)))
    pictures = Page(committed("scenes.html")).pictures
    for file in (f"{name}.webp", f"{name}.depth.webp"):
        picture = cv2.imread(str(PAGES / file))
        assert picture is not None and picture.shape[1::-1] == expected, STALE
        shown = pictures[file]
        assert shown["alt"] and (int(shown["width"]), int(shown["height"])) == expected


@pytest.mark.parametrize("name", DOCUMENT)
def test_the_documents_pictures_are_there_in_full_size(name: str) -> None:
    picture = cv2.imread(str(PAGES.parent / "images" / f"{name}.webp"))
    assert picture is not None and picture.shape[1::-1] == tracer.load(name).camera.resolution, STALE


def test_thumbnails_are_small() -> None:
    assert sum(file.stat().st_size for file in PAGES.glob("*.webp")) < LARGEST_TOTAL


def test_the_page_needs_nothing_from_outside() -> None:
    """No address, no script, no style sheet, no font: only pictures that lie beside it."""
    text = committed("scenes.html")
    outside = re.sub(r"<pre.*?</pre>", "", text, flags=re.DOTALL)
    assert not re.search(r"//|<script|<link|@import|url\(|srcset", outside)
    page = Page(text)
    assert all((PAGES / source).is_file() for source in page.pictures)
    assert all(link.startswith("#") and link[1:] in page.ids for link in page.links)
    assert len(set(page.ids)) == len(page.ids)


def test_links_of_the_overview_lead_somewhere() -> None:
    text = committed("index.md")
    assert [link for link in LINK.findall(text) if not (PAGES / link).is_file()] == []
    ids = Page(committed("scenes.html")).ids
    anchors = re.findall(r'href="scenes\.html#([^"]+)"', text)
    assert anchors == [entry.name for entry in entries()] and set(anchors) <= set(ids)


# ---- The program ----


@pytest.fixture
def small_scene(tmp_path: Path) -> Entry:
    cv2.imwrite(str(tmp_path / "picture.png"), np.full((2, 2, 3), 200, np.uint8))
    file = tmp_path / "ball.toml"
    file.write_text(SMALL_SCENE, encoding="utf-8")
    return read_entry(file)


def files_of(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def test_the_same_scene_gives_the_same_bytes(tmp_path: Path, small_scene: Entry) -> None:
    """Rendered anew elsewhere, and from the kept render; a thumbnail that nobody needs goes."""
    first, second = tmp_path / "first", tmp_path / "second"
    assert make_gallery([small_scene], first, tmp_path / "images", tmp_path / "renders") == ["ball"]
    assert make_gallery([small_scene], second, tmp_path / "images", tmp_path / "other renders") == ["ball"]
    made = files_of(first)
    assert sorted(made) == ["ball.depth.webp", "ball.webp", FINGERPRINTS, "index.md", "scenes.html"]
    assert files_of(second) == made
    (first / "gone.depth.webp").touch()
    assert make_gallery([small_scene], first, tmp_path / "images", tmp_path / "renders") == []
    assert files_of(first) == made
    page = Page(made["scenes.html"].decode())
    assert page.scene_texts == [SMALL_SCENE]
    assert page.pictures["ball.webp"]["alt"].endswith("A ball with <angle> brackets & [square] ones.")


def test_a_redrawn_picture_makes_the_render_stale(small_scene: Entry) -> None:
    """The scene's own hash does not see it."""
    cv2.imwrite(str(small_scene.path.parent / "picture.png"), np.zeros((2, 2, 3), np.uint8))
    assert read_entry(small_scene.path).fingerprint != small_scene.fingerprint


def test_a_comment_does_not_make_the_render_stale(small_scene: Entry) -> None:
    small_scene.path.write_text(SMALL_SCENE + "# the end\n", encoding="utf-8")
    again = read_entry(small_scene.path)
    assert again.fingerprint == small_scene.fingerprint
    assert again.text != small_scene.text


def test_order_of_the_scenes() -> None:
    """The document's pictures in its order, then group after group; every scene once."""
    found = entries()
    assert sorted(entry.name for entry in found) == sorted(NAMES)
    assert [entry.name for entry in found][:4] == [
        "classic",
        "classic_rotated",
        "classic_focus",
        "classic_rabbit",
    ]
    titles = [*GROUPS.values(), OTHERS]
    order = [titles.index(entry.group) for entry in found]
    assert order == sorted(order)


# ---- The depth buffer as a picture ----

PLANE = np.array([[-1.0, 4.0, 5.0], [6.0, 8.0, 1e6]])


def test_near_is_bright_and_far_is_dark_and_blank_is_gray() -> None:
    scale = DepthScale.of(PLANE)
    assert (scale.near, scale.median, scale.far, scale.blank) == (4, 6, 1e6, pytest.approx(1 / 6))
    colors = paint(PLANE, scale)
    assert tuple(colors[0, 0]) in {(gray, gray, gray) for gray in GRAYS}
    lightness = colors.reshape(-1, 3).sum(axis=1, dtype=int)[1:]
    assert (np.diff(lightness) < 0).all()
    blue, green, red = colors[0, 1]
    assert colors_of_the_bar(3)[0] == f"#{red:02x}{green:02x}{blue:02x}"


def test_brightness_is_the_inverse_of_depth() -> None:
    """s / (s + d - near), stretched: the median lies in the middle but for the stretching."""
    scale = DepthScale.of(PLANE)
    assert scale.brightness(np.array([4.0, 6.0, 1e6])) == pytest.approx([1, 0.5, 0], abs=1e-5)
    depths = [scale.depth(brightness) for brightness in (1, 0.75, 0.5, 0.25, 0)]
    assert scale.brightness(np.array(depths)) == pytest.approx([1, 0.75, 0.5, 0.25, 0])


def test_equal_depths_have_one_color() -> None:
    """Rounding and the obliqueness of far rays are not blown up into rings."""
    wall = np.full((2, 3), 300.0)
    wall[0, 0] += 0.001
    assert len(np.unique(paint(wall, DepthScale.of(wall)).reshape(-1, 3), axis=0)) == 1


@pytest.mark.parametrize("most", [5.0, 0.0])
def test_a_wall_of_equal_depth_does_not_hide_the_rest(most: float) -> None:
    """Most pixels equally near: the softening has a least value, and nothing is divided by zero."""
    scale = DepthScale.of(np.array([[most, most, most, most, 10.0, 20.0]]))
    near, middle, far = scale.brightness(np.array([most, 10.0, 20.0]))
    assert near == 1 and 0 < middle < 1 and far == 0


def test_a_picture_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="no pixel of the depth buffer hits anything"):
        DepthScale.of(np.full((2, 2), -1.0))


# ---- Thumbnails and numbers ----


def test_pictures_are_exact_where_that_is_cheap() -> None:
    noise = np.random.default_rng(3).integers(0, 256, (240, 320, 3), dtype=np.uint8)
    for image, exact in ((noise[:40, :40], True), (noise, False)):
        kept = cv2.imdecode(np.frombuffer(thumbnail(image), np.uint8), cv2.IMREAD_COLOR)
        assert np.array_equal(kept, image) == exact


@pytest.mark.parametrize(
    ("size", "expected"), [((320, 240), (320, 240)), ((1280, 960), (640, 480)), ((1024, 1024), (640, 640))]
)
def test_size_of_thumbnails(size: tuple[int, int], expected: tuple[int, int]) -> None:
    image = np.zeros((size[1], size[0], 3), np.uint8)
    kept = cv2.imdecode(np.frombuffer(thumbnail(image), np.uint8), cv2.IMREAD_COLOR)
    assert thumbnail_size(image) == kept.shape[1::-1] == expected


def test_numbers_on_the_pages(small_scene: Entry) -> None:
    scale = DepthScale.of(PLANE)
    exhibit = Exhibit(small_scene, scale, 24, 18)
    assert exhibit.range == "4.00 to 1,000,000"
    assert exhibit.ticks == ["near 4.00", "4.67", "6.00", "10.0", "far 1,000,000"]
    assert exhibit.blank == "17 %"
    assert "| picture | depth 4.00 to 1,000,000 |" in index_page([exhibit])
    assert "blank in 17 % of the pixels" in scenes_page([exhibit])
    flat = Exhibit(small_scene, DepthScale(300, 300, 300, 0), 24, 18)
    assert flat.ticks == ["300 everywhere"] and flat.blank == ""
    assert Exhibit(small_scene, DepthScale(1, 2, 3, 0.001), 24, 18).blank == "under 1 %"
