"""`tracer view` in a browser: the page, driven as a user drives it, and what is written and said."""

from __future__ import annotations

import base64
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest

from tracer.scene.toml_files import parse_toml

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytestmark = pytest.mark.slow

PATIENCE = 60_000  # milliseconds: the first picture waits for kernels
BALL = """
camera.resolution = [64, 48]
[[shapes]]
kind = "sphere"
center = [0, 0, -9]
radius = 1
"""
CHOICES = ("trees", "texture_3d", "tetrahedron", "cube", "rabbit", "rotate")

AT_REST = """() => {
  const { picture, panel, link } = window.viewer ?? {};
  return picture?.header?.final && picture.header.revision === panel.revision && panel.heard === link.stamp;
}"""
PIXELS = "() => viewer.picture.canvas.toDataURL('image/png').split(',')[1]"

Start = Callable[..., "Viewer"]


class Viewer:
    """A running `tracer view`."""

    def __init__(self, folder: Path, repository: Path, *arguments: str) -> None:
        self.folder = folder
        self.environment = {**os.environ, "PYTHONPATH": str(repository)}
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tracer.cli", "view", *arguments],
            cwd=folder,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout is not None
        self.url = self.process.stdout.readline().strip()

    def end(self, number: signal.Signals = signal.SIGINT) -> tuple[int, str]:
        """Ends it; the exit code and what it said on stderr."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        _, said = self.process.communicate(timeout=120)
        return self.process.returncode, said

    def tracer(self, *arguments: str) -> None:
        """Runs another command in the same folder."""
        subprocess.run(
            [sys.executable, "-m", "tracer.cli", *arguments],
            cwd=self.folder,
            env=self.environment,
            check=True,
            capture_output=True,
            timeout=120,
        )


@pytest.fixture(scope="module")
def start(repository: Path) -> Iterator[Start]:
    running: list[Viewer] = []

    def run(folder: Path, *arguments: str) -> Viewer:
        running.append(Viewer(folder, repository, *arguments))
        return running[-1]

    yield run
    for viewer in running:
        if viewer.process.poll() is None:
            viewer.process.kill()
            viewer.process.communicate()


@pytest.fixture(scope="module")
def viewer(start: Start, tmp_path_factory: pytest.TempPathFactory) -> Viewer:
    """The classic room; each test opens a page of its own and leaves the room as it was."""
    return start(tmp_path_factory.mktemp("viewer"), "classic", "--resolution", "160", "120")


@pytest.fixture
def page(browser: Browser, viewer: Viewer) -> Iterator[Page]:
    """The page at rest. At the end its console must be empty, and it must have asked nobody else."""
    context = browser.new_context(viewport={"width": 1180, "height": 760})
    opened = context.new_page()
    complaints: list[str] = []
    opened.on("console", lambda message: complaints.append(f"{message.type}: {message.text}"))
    opened.on("pageerror", lambda error: complaints.append(str(error)))
    ours = (viewer.url, "blob:", "data:")
    opened.on("request", lambda request: request.url.startswith(ours) or complaints.append(request.url))
    opened.goto(viewer.url)
    at_rest(opened)
    yield opened
    while opened.locator("#undo").is_enabled():
        opened.evaluate("() => viewer.link.change('undo')")
        at_rest(opened)
    opened.evaluate("() => viewer.link.change('show', {layer: 'color'})")
    at_rest(opened)
    context.close()
    assert not complaints


def at_rest(page: Page) -> np.ndarray:
    """The pixels (h, w, 3) of the finished picture of what the panel shows."""
    page.wait_for_timeout(50)  # a slider sends what it is told with the next picture of the screen
    page.wait_for_function(AT_REST, timeout=PATIENCE)
    png = np.frombuffer(base64.b64decode(page.evaluate(PIXELS)), np.uint8)
    return np.asarray(cv2.imdecode(png, cv2.IMREAD_COLOR))


def difference(a: np.ndarray, b: np.ndarray) -> float:
    """Mean over the pixels, of 255."""
    return float(np.abs(a.astype(int) - b).mean())


def middle(page: Page) -> tuple[float, float]:
    box = page.locator("#picture").bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def test_the_page_shows_the_picture(page: Page) -> None:
    picture = at_rest(page)
    assert picture.shape == (120, 160, 3) and picture.std() > 30
    assert page.title() == "classic · tracer view"
    assert page.locator("#quality").inner_text() == "3 × 3 rays a pixel"
    assert page.locator("#wait").is_hidden()


def test_dragging_turns_the_camera_and_undo_brings_it_back(page: Page) -> None:
    before, (x, y) = at_rest(page), middle(page)
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(1, 9):
        page.mouse.move(x + 12 * step, y + 2 * step)
    page.mouse.up()
    turned = at_rest(page)
    assert difference(before, turned) > 5
    assert "rotate = [-" in page.locator("#toml").inner_text(), "to the right: the camera goes left"
    page.keyboard.press("z")
    assert difference(before, at_rest(page)) == 0


def test_wheel_keys_and_the_documents_moves_change_the_picture(page: Page) -> None:
    pictures = [at_rest(page)]
    page.mouse.move(*middle(page))
    page.mouse.wheel(0, -200)
    pictures.append(at_rest(page))
    page.locator("#picture").focus()
    page.keyboard.press("Shift+ArrowLeft")
    pictures.append(at_rest(page))
    for name in ("x_rotate +", "y_rotate −", "move z +"):
        page.get_by_role("button", name=name).click()
        pictures.append(at_rest(page))
    assert all(difference(a, b) > 1 for a, b in zip(pictures, pictures[1:], strict=False))
    page.get_by_role("button", name="Reset").click()
    assert difference(pictures[0], at_rest(page)) == 0


def test_the_camera_is_copied_as_the_table_of_a_scene_file(page: Page) -> None:
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.get_by_role("button", name="x_rotate +").click()
    at_rest(page)
    page.get_by_role("button", name="Copy as TOML").click()
    page.get_by_text("copied").wait_for()
    text = page.evaluate("() => navigator.clipboard.readText()")
    assert parse_toml(text, "clipboard")["camera"]["rotate"] == [5.0, -12.0]


def test_each_of_the_six_choices_changes_the_picture(page: Page) -> None:
    first = before = at_rest(page)
    for name in CHOICES:
        answer = page.locator(f'input[name="choice-{name}"]:checked').input_value()
        page.locator(f'input[name="choice-{name}"][value="{1 - int(answer)}"]').check()
        after = at_rest(page)
        assert difference(before, after) > 0.05, name
        before = after
    for _ in CHOICES:
        page.get_by_role("button", name="Undo").click()
    assert difference(first, at_rest(page)) == 0


def test_a_slider_works_while_it_moves(page: Page) -> None:
    before = at_rest(page)
    reflection, refraction = (
        page.locator(f'[data-number="materials.glass.{key}"]') for key in ("reflection", "refraction")
    )
    page.locator("summary", has_text="Materials").click()
    slider = page.locator('[data-control="materials.glass.refraction"]')
    slider.fill("300")
    after = at_rest(page)
    assert difference(before, after) > 0.5
    assert refraction.input_value() == "0.3"
    assert float(reflection.input_value()) == pytest.approx(0.08 * 0.7 / 0.12, rel=1e-3)
    page.locator('[data-number="ambient"]').fill("0.9")
    page.locator('[data-number="ambient"]').press("Enter")
    assert difference(after, at_rest(page)) > 5


def test_a_color_is_that_of_the_file_until_it_is_edited(page: Page) -> None:
    before = at_rest(page)
    lamp = page.locator('[data-color="lights.0.color"]')
    first = lamp.input_value()
    lamp.fill("#ff0000")
    assert difference(before, at_rest(page)) > 3
    assert lamp.get_attribute("title") == "sRGB 1, 0, 0"
    lamp.focus()
    page.keyboard.press("z")
    assert difference(before, at_rest(page)) == 0
    assert lamp.input_value() == first


def test_depth_of_field_has_a_focus(page: Page) -> None:
    before = at_rest(page)
    page.locator("#focus").check()
    page.locator('[data-number="camera.depth_of_field.focus"]').wait_for()
    page.locator('[data-control="camera.depth_of_field.focus"]').fill("100")
    assert difference(before, at_rest(page)) > 0.5


def test_every_layer_is_another_picture(page: Page) -> None:
    layers = page.locator("#layer option").evaluate_all("options => options.map(option => option.value)")
    assert layers == [
        *("color", "depth", "normal", "shape", "level", "rays"),
        *("visibility.light0", "visibility.light1", "visibility.light2"),
    ]
    pictures = [at_rest(page)]
    for layer in layers[1:]:
        page.locator("#layer").select_option(layer)
        picture = at_rest(page)
        assert all(difference(picture, other) > 3 for other in pictures), layer
        pictures.append(picture)


def test_a_click_draws_the_rays_of_a_pixel(page: Page) -> None:
    """The mirror ball, in the left half of the picture."""
    box = page.locator("#picture").bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + 0.28 * box["width"], box["y"] + 0.5 * box["height"])
    page.locator("#tree").wait_for()
    rows = page.locator("#branches li").all_inner_texts()
    assert rows[0] == "1.000 primary → mirror ball"
    assert re.fullmatch(r"0\.880 mirrored → .*", rows[1])
    assert page.locator("#rays line").count() >= 2
    page.get_by_role("button", name="Close").first.click()
    assert page.locator("#rays line").count() == 0


def test_saved_scene_and_still_are_the_same_picture(page: Page, viewer: Viewer) -> None:
    page.get_by_role("button", name="x_rotate +").click()
    page.locator('[data-control="lights.0.weight"]').fill("0")
    page.locator('[data-color="lights.1.color"]').fill("#80ff40")
    at_rest(page)
    for label, file in (("Still (PNG)", ".png"), ("Still (EXR)", ".exr"), ("Scene (TOML)", ".toml")):
        page.get_by_role("button", name=label).click()
        page.get_by_text(f"saved classic-view-1{file}").wait_for()
    assert sorted(path.name for path in viewer.folder.iterdir()) == [
        f"classic-view-1{suffix}" for suffix in (".exr", ".png", ".toml")
    ]
    viewer.tracer("render", "classic-view-1.toml", "-o", "again.png", "-o", "again.exr")
    for suffix in (".png", ".exr"):
        still, again = (viewer.folder / f"{stem}{suffix}" for stem in ("classic-view-1", "again"))
        assert still.read_bytes() == again.read_bytes()


def test_a_wrong_message_does_no_harm(page: Page) -> None:
    before = at_rest(page)
    page.evaluate("() => viewer.link.send({kind: 'set', name: 'base_dir', value: 1})")
    page.evaluate("() => viewer.link.send({kind: 'show', layer: '../../etc/passwd'})")
    page.evaluate("() => viewer.link.send({kind: 'orbit', left: 'x'})")
    page.evaluate("() => viewer.link.send('')")
    page.get_by_text("Input should be").wait_for()
    assert difference(before, at_rest(page)) == 0


def test_our_picture_beside_mitsubas(page: Page) -> None:
    page.get_by_role("button", name="Compare with Mitsuba").click()
    page.locator("#comparison").wait_for(timeout=PATIENCE)
    verdict = page.locator("#verdict").inner_text()
    found = re.search(r"(\d+) of 19200 pixels differ", verdict)
    assert found is not None and int(found[1]) < 20
    widths = page.locator("#comparison img").evaluate_all("images => images.map(image => image.naturalWidth)")
    assert widths == [160, 160, 160]
    page.locator("#comparison").get_by_role("button", name="Close").click()


def test_a_second_viewer_takes_a_free_port_and_both_end_with_ctrl_c(
    start: Start, tmp_path: Path, viewer: Viewer
) -> None:
    (tmp_path / "ball.toml").write_text(BALL)
    second, third = (start(tmp_path, "ball.toml") for _ in range(2))
    assert len({viewer.url, second.url, third.url}) == 3
    busy = start(tmp_path, "ball.toml", "--port", viewer.url.split(":")[2].strip("/"))
    code, said = busy.end()
    assert code == 2 and "cannot listen there" in said, "a port that was asked for is not exchanged"
    assert second.end() == (0, "")
    assert third.end(signal.SIGTERM) == (0, "")


def test_another_address_is_a_warning_and_a_token(start: Start, tmp_path: Path, browser: Browser) -> None:
    (tmp_path / "ball.toml").write_text(BALL)
    viewer = start(tmp_path, "ball.toml", "--host", "0.0.0.0")
    url = viewer.url.replace("0.0.0.0", "127.0.0.1")
    context = browser.new_context()
    page = context.new_page()
    answer = page.goto(url.partition("?")[0])
    assert answer is not None and answer.status == 403
    page.goto(url)
    at_rest(page)
    assert "token" not in page.url
    page.reload()
    at_rest(page)
    context.close()
    stranger = browser.new_context()
    answer = stranger.new_page().goto(url)
    assert answer is not None and answer.status == 403, "the token serves once"
    stranger.close()
    code, said = viewer.end()
    assert code == 0 and said.startswith("tracer: warning: 0.0.0.0 can be reached by others")


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("no.toml",), 2, "there is no such scene file"),
        (("classic", "--host", "no.such.host.invalid"), 2, "cannot listen there"),
        (("classic", "--resolution", "0", "1"), 2, "0 is not in the range"),
    ],
)
def test_what_cannot_be_shown_is_one_sentence(
    start: Start, tmp_path: Path, arguments: tuple[str, ...], code: int, said: str
) -> None:
    viewer = start(tmp_path, *arguments)
    found, sentence = viewer.end()
    assert found == code and said in sentence and "Traceback" not in sentence
