"""`python -m scripts.gallery`: writes docs/gallery, and the document's pictures to docs/images."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

from scripts.gallery.depth import DepthScale, paint
from scripts.gallery.entries import DOCUMENT, Entry, entries
from scripts.gallery.pages import Exhibit, index_page, scenes_page
from scripts.gallery.renders import rendered
from scripts.gallery.thumbnails import full_size, thumbnail, thumbnail_size
from tracer.errors import TracerError
from tracer.film.atomic import atomic_write

ROOT = Path(__file__).resolve().parents[2]
PAGES = ROOT / "docs" / "gallery"
IMAGES = ROOT / "docs" / "images"
RENDERS = ROOT / "out" / "gallery"
FINGERPRINTS = "fingerprints.json"
"""Scene names and the fingerprints of what was rendered; tests/unit/test_gallery.py compares them."""


def make_gallery(found: list[Entry], pages: Path, images: Path, renders: Path) -> list[str]:
    """Writes the pages and thumbnails of these scenes to `pages` and removes thumbnails of other scenes.

    The document's own pictures go to `images` in full size. All renders are kept in `renders`. Returns the
    names of the scenes that were rendered anew. Raises TracerError.
    """
    for folder in (pages, images, renders):
        folder.mkdir(parents=True, exist_ok=True)
    exhibits, anew = [], []
    for entry in found:
        render, fresh = rendered(entry, renders)
        if fresh:
            anew.append(entry.name)
            click.echo(f"{entry.name} rendered", err=True)
        scale = DepthScale.of(render.depth)
        colors = paint(render.depth, scale)
        write(pages / f"{entry.name}.webp", thumbnail(render.picture))
        write(pages / f"{entry.name}.depth.webp", thumbnail(colors))
        if entry.name in DOCUMENT:
            write(images / f"{entry.name}.webp", full_size(render.picture))
        exhibits.append(Exhibit(entry, scale, *thumbnail_size(colors)))
    write(pages / "index.md", index_page(exhibits).encode())
    write(pages / "scenes.html", scenes_page(exhibits).encode())
    fingerprints = {entry.name: entry.fingerprint for entry in found}
    write(pages / FINGERPRINTS, (json.dumps(fingerprints, indent=1) + "\n").encode())
    for file in pages.glob("*.webp"):
        if file.name.partition(".")[0] not in fingerprints:
            file.unlink()
    return anew


def write(file: Path, content: bytes) -> None:
    """The whole file or nothing."""
    with atomic_write(file) as temporary:
        temporary.write_bytes(content)


def main() -> None:
    """Makes the gallery; an error is one sentence and the exit code of its class."""
    try:
        found = entries()
        anew = make_gallery(found, PAGES, IMAGES, RENDERS)
    except TracerError as error:
        click.echo(f"Error: {error}", err=True)
        sys.exit(error.exit_code)
    size = sum(file.stat().st_size for file in PAGES.glob("*.webp"))
    click.echo(
        f"docs/gallery: {len(found)} scenes, {len(anew)} rendered anew, {size / 1e3:.0f} kB of pictures"
    )


if __name__ == "__main__":
    main()
