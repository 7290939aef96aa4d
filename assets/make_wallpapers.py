"""Draws the pictures of the scenes: fox.png, forest.png and marble.png.

Run `python assets/make_wallpapers.py [FOLDER]`: without a folder, into this one.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
from drawing import forest, fox, marble

PICTURES = {"fox.png": fox.draw, "forest.png": forest.draw, "marble.png": marble.draw}


def main(folder: Path) -> None:
    """Writes every picture into the folder."""
    for name, draw in PICTURES.items():
        red_last = draw()[:, :, ::-1]
        cv2.imwrite(str(folder / name), red_last, [cv2.IMWRITE_PNG_COMPRESSION, 9])


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent)
