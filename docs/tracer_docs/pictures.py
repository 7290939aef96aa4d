"""Pictures that the build makes: where they lie, and the nodes that show them."""

from __future__ import annotations

import os
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

import tracer

WIDTH = 800  # pixels of a rendered picture's longer side


def picture_folder(app: Sphinx) -> Path:
    """Where made pictures wait for the builder to take them."""
    folder = Path(app.doctreedir) / "pictures"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def image(env: BuildEnvironment, path: Path, alt: str, *classes: str) -> nodes.image:
    """The node of a made picture."""
    uri = "/" + Path(os.path.relpath(path, env.srcdir)).as_posix()
    return nodes.image(uri=uri, alt=alt, classes=["drawing" if path.suffix == ".svg" else "made", *classes])


def figure(caption: str, *images: nodes.image) -> nodes.figure:
    """Pictures above one caption (none for an empty one)."""
    children: list[nodes.Node] = list(images)
    if caption:
        children.append(nodes.caption("", caption))
    return nodes.figure("", *children, align="center")


def rendered(app: Sphinx, scene: tracer.Scene, name: str) -> Path:
    """Renders a scene small, to `name`.png."""
    path = picture_folder(app) / f"{name}.png"
    small = min(1.0, WIDTH / max(scene.camera.resolution))
    tracer.render(scene, scale=small, supersample=2).save(path)
    return path
