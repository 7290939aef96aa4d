"""The tutorial's directives: tables of a scene file, added step by step, with pictures of the scene so far.

    ```{scene-step}
    :add: lights.*(point), shapes.floor
    :alt: what the picture shows
    ```

shows the lines that are new and renders what is there. Text and picture come out of the file itself, so they
cannot disagree; a page that does not end with the whole file fails. `{classic}` puts a value of that file
into the text, `{scene-file}` shows a whole scene file and its picture.
"""

from __future__ import annotations

from typing import cast

from docutils import nodes
from docutils.parsers.rst import directives
from docutils.parsers.rst.states import Inliner
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.logging import getLogger

import tracer
from tracer.assets import SCENES
from tracer.scene.toml_files import parse_toml
from tracer_docs.pictures import figure, image, rendered
from tracer_docs.scene_file import Growing, read_tables, value_at

CLASSIC = SCENES / "classic.toml"
SCENE_KEY, STEP_KEY = "tracer_tutorial_scene", "tracer_tutorial_step"


def patterns_of(argument: str) -> list[str]:
    """The patterns of the option `:add:`."""
    return [pattern.strip() for pattern in argument.split(",")]


class SceneStep(SphinxDirective):
    """Adds tables of scenes/classic.toml, shows their text and renders the scene so far."""

    option_spec = {"add": patterns_of, "alt": directives.unchanged, "no-picture": directives.flag}

    def run(self) -> list[nodes.Node]:
        self.env.note_dependency(str(CLASSIC))
        growing = cast(Growing, self.env.temp_data.setdefault(SCENE_KEY, Growing(CLASSIC)))
        number = cast(int, self.env.temp_data.setdefault(STEP_KEY, 0)) + 1
        self.env.temp_data[STEP_KEY] = number
        try:
            new = growing.add(self.options["add"])
        except LookupError as error:
            raise self.error(str(error)) from None
        code = nodes.literal_block("", "\n\n".join(table.text for table in new), language="toml")
        if "no-picture" in self.options:
            return [code]
        scene = tracer.load(parse_toml(growing.text, CLASSIC.name), base_dir=SCENES)
        picture = rendered(self.env.app, scene, f"{self.env.docname}-{number}")
        return [code, figure("", image(self.env, picture, self.options["alt"]))]


class SceneFile(SphinxDirective):
    """Shows a built-in scene's tables, without the comment that opens the file, and its picture."""

    required_arguments = 1
    option_spec = {"alt": directives.unchanged}

    def run(self) -> list[nodes.Node]:
        path = SCENES / f"{self.arguments[0]}.toml"
        self.env.note_dependency(str(path))
        self.env.note_dependency(str(CLASSIC))
        text = "\n\n".join(table.text for table in read_tables(path))
        picture = rendered(self.env.app, tracer.load(path), path.stem)
        return [
            nodes.literal_block("", text, language="toml"),
            figure("", image(self.env, picture, self.options["alt"])),
        ]


def classic_value(
    name: str,
    rawtext: str,
    text: str,
    lineno: int,
    inliner: Inliner,
    options: object = None,
    content: object = None,
) -> tuple[list[nodes.Node], list[nodes.system_message]]:
    """A value of scenes/classic.toml, as in {classic}`shapes.red ball.radius`."""
    try:
        value = value_at(read_tables(CLASSIC), text)
    except LookupError as error:
        message = inliner.reporter.error(str(error), line=lineno)
        return [inliner.problematic(rawtext, rawtext, message)], [message]
    shown = f"{value:g}" if isinstance(value, float) else str(value)
    return [nodes.literal("", shown)], []


def check_completeness(app: Sphinx, doctree: nodes.document) -> None:
    """A warning, and so a failure, where the steps of a page do not add up to the file."""
    growing = app.env.temp_data.get(SCENE_KEY)
    if growing is not None and growing.missing:
        left = ", ".join(growing.missing)
        getLogger(__name__).warning("%s: no step adds %s", CLASSIC.name, left, location=app.env.docname)


def setup(app: Sphinx) -> dict[str, bool]:
    """Registers the directives and the role."""
    app.add_directive("scene-step", SceneStep)
    app.add_directive("scene-file", SceneFile)
    app.add_role("classic", classic_value)
    app.connect("doctree-read", check_completeness)
    return {"parallel_read_safe": False, "parallel_write_safe": True}
