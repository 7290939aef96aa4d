"""Where the built-in scenes and the assets (meshes, pictures) lie: in a checkout or in the package."""

from __future__ import annotations

from pathlib import Path

PACKAGE = Path(__file__).resolve().parent


def _folder(name: str) -> Path:
    """`tracer/data/NAME` of an installed package, or `NAME` at the root of a source checkout."""
    installed = PACKAGE / "data" / name
    return installed if installed.is_dir() else PACKAGE.parent / name


ASSETS = _folder("assets")
SCENES = _folder("scenes")


def builtin_scenes() -> dict[str, Path]:
    """The built-in scenes: name to file, sorted by name."""
    return {path.stem: path for path in sorted(SCENES.glob("*.toml"))}
