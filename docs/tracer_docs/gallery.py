"""Takes the gallery's own page, scenes.html, and its pictures to the site as they are."""

from __future__ import annotations

import shutil
from pathlib import Path

from sphinx.application import Sphinx


def copy_page(app: Sphinx, error: Exception | None) -> None:
    """Copies what docs/gallery/index.md links to without being a source of the site."""
    folder, target = Path(app.srcdir) / "gallery", Path(app.outdir) / "gallery"
    if error is None:
        for file in [folder / "scenes.html", *folder.glob("*.webp")]:
            shutil.copyfile(file, target / file.name)


def setup(app: Sphinx) -> dict[str, bool]:
    """Registers the copying."""
    app.connect("build-finished", copy_page)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
