"""What commands say of layers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tracer.film.result import layer_file

LOST_LAYERS = "the layers of --aov go to .exr and .npz files, and -o names none; --aov-png shows them"


def loses_layers(layers: Sequence[str], files: Sequence[str]) -> bool:
    """Whether layers are asked for and none of the files takes them."""
    return bool(layers) and not any(Path(file).suffix.lower() in (".exr", ".npz") for file in files)


def told_layers(file: str, layers: Sequence[str]) -> list[str]:
    """How the pictures of layers beside a file are told: `out/a.LAYER.png (17 layers)`."""
    return [f"{layer_file(file, 'LAYER')} ({len(layers)} layer{'s' * (len(layers) > 1)})"] if layers else []
