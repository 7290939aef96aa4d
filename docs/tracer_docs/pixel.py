"""The directives of the page "How a pixel gets its color"; every number is computed while the page is built.

`{pixel-picture}`, `{pixel-drawing} rays|tree`, `{pixel-tour}`, `{pixel-arithmetic}`, `{pixel-rays}`, and the
role `{pixel}` for a number in the text.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from docutils import nodes
from docutils.parsers.rst.states import Inliner
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective

import tracer
from tracer.assets import SCENES
from tracer.color import quantize
from tracer_docs import ray_tree
from tracer_docs.drawings import save_drawings
from tracer_docs.pictures import WIDTH, figure, image, picture_folder
from tracer_docs.pixel_text import arithmetic, facts, ray_table, sentence_about
from tracer_docs.ray_tree import Story

CUT_OUT = 32  # pixels of the enlarged part, in both directions


def story() -> Story:
    """The pixel; a build fails where its tree does not add up."""
    try:
        return ray_tree.story()
    except ValueError as error:
        raise ExtensionError(str(error)) from None


class PixelPicture(SphinxDirective):
    """The whole picture with the pixel marked, and its neighborhood enlarged."""

    def run(self) -> list[nodes.Node]:
        note(self)
        told = story()
        path = picture_folder(self.env.app) / "pixel.png"
        write_picture(told, path)
        alt = f"The classic room with a ring around pixel ({told.column}, {told.row}), and that part enlarged"
        return [
            figure("Left: the picture. Right: the pixel among its neighbors.", image(self.env, path, alt))
        ]


def write_picture(told: Story, path: Path) -> None:
    """The picture (a ring around the pixel) and beside it the pixels around, both of one height."""
    width, height = told.scene.camera.resolution
    scale = WIDTH / max(width, height)
    whole = tracer.render(told.scene, scale=scale, supersample=2).color
    left = min(max(0, told.column - CUT_OUT // 2), width - CUT_OUT)
    top = min(max(0, told.row - CUT_OUT // 2), height - CUT_OUT)
    near = tracer.render(told.scene, supersample=1, crop=(left, top, left + CUT_OUT, top + CUT_OUT)).color
    size = whole.shape[0] // CUT_OUT
    near = near.repeat(size, axis=0).repeat(size, axis=1)
    whole, near = (np.ascontiguousarray(quantize(part, 8)[..., ::-1]) for part in (whole, near))
    middle = (round((told.column + 0.5) * scale), round((told.row + 0.5) * scale))
    for color, thickness in (((0, 0, 0), 6), ((255, 255, 255), 2)):
        cv2.circle(whole, middle, round(CUT_OUT * scale), color, thickness, cv2.LINE_AA)
        corner = np.array([told.column - left, told.row - top]) * size
        cv2.rectangle(near, (corner - 2).tolist(), (corner + size + 1).tolist(), color, thickness // 2 + 1)
    gap = np.full((near.shape[0], 16, 3), 127, np.uint8)
    cv2.imwrite(str(path), np.hstack([whole[: near.shape[0]], gap, near]))


class PixelDrawing(SphinxDirective):
    """The rays in the room, or the tree; one drawing for each theme."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        note(self)
        name = self.arguments[0]
        alts = {
            "rays": "The room from the left and from above, with the rays of the pixel, numbered",
            "tree": "The tree of rays: a box for each ray, branches labeled with their shares",
        }
        paths = save_drawings(story(), picture_folder(self.env.app))[name]
        return [
            figure("", *(image(self.env, path, alts[name], f"only-{look}") for look, path in paths.items()))
        ]


class PixelTour(SphinxDirective):
    """One sentence a ray."""

    def run(self) -> list[nodes.Node]:
        note(self)
        told = story()
        items = [nodes.list_item("", nodes.paragraph("", text)) for text in map(sentence_about, told.rays)]
        return [nodes.enumerated_list("", *items, enumtype="arabic", prefix="", suffix=".")]


class PixelArithmetic(SphinxDirective):
    """The rule of the model with the numbers of the first ray, channel by channel."""

    def run(self) -> list[nodes.Node]:
        note(self)
        return [nodes.literal_block("", "\n".join(arithmetic(story())), language="text")]


class PixelRays(SphinxDirective):
    """A table with a row a ray: what its hit adds to the pixel, term by term; the sum; the tracer's color."""

    def run(self) -> list[nodes.Node]:
        note(self)
        return [nodes.raw("", "".join(ray_table(story())), format="html")]


def pixel_fact(
    name: str,
    rawtext: str,
    text: str,
    lineno: int,
    inliner: Inliner,
    options: object = None,
    content: object = None,
) -> tuple[list[nodes.Node], list[nodes.system_message]]:
    """A number of the pixel, as in {pixel}`cutoff`."""
    known = facts(story())
    if text not in known:
        message = inliner.reporter.error(f"the pixel has no {text!r}; it has {', '.join(known)}", line=lineno)
        return [inliner.problematic(rawtext, rawtext, message)], [message]
    return [nodes.inline("", known[text], classes=["pixel-fact"])], []


def note(directive: SphinxDirective) -> None:
    """The page depends on the scene."""
    directive.env.note_dependency(str(SCENES / "classic.toml"))


def setup(app: Sphinx) -> dict[str, bool]:
    """Registers the directives and the role."""
    app.add_directive("pixel-picture", PixelPicture)
    app.add_directive("pixel-drawing", PixelDrawing)
    app.add_directive("pixel-tour", PixelTour)
    app.add_directive("pixel-arithmetic", PixelArithmetic)
    app.add_directive("pixel-rays", PixelRays)
    app.add_role("pixel", pixel_fact)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
