"""The forest wallpaper: firs, leafy trees and birches on three lines of hills, one behind the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drawing.sheet import Outline, Sheet, ellipse, path

WIDTH, HEIGHT = 640, 640
HILLS = ("#f4ecc9", "#d6e6bf", "#b3d6c3")
PINE, SPRUCE, FERN, MOSS = "#2f6657", "#3f7d66", "#6fa37d", "#9dbd7a"
OCHRE, RUST, ROSE = "#e6ae55", "#cf7146", "#d98f7c"
WOOD, BARK, BIRCH, INK, CREAM = "#7a5543", "#5b4036", "#f8f4e8", "#4c4540", "#fff7e6"

TIER = path("M 0 -58 C 10 -34 26 -10 44 2 C 30 8 16 6 0 6 C -16 6 -30 8 -44 2 C -26 -10 -10 -34 0 -58")
TIER_SHADE = path("M 0 -58 C 10 -34 26 -10 44 2 C 30 8 16 6 0 6 C 8 -12 8 -34 0 -58")
DROP = path(
    "M 0 -168 C 26 -128 46 -92 46 -60 C 46 -30 26 -16 0 -16"
    " C -26 -16 -46 -30 -46 -60 C -46 -92 -26 -128 0 -168"
)
DROP_SHADE = path("M 0 -168 C 26 -128 46 -92 46 -60 C 46 -30 26 -16 0 -16 C 20 -50 20 -120 0 -168")
CROWN = path(
    "M -58 -84 C -62 -112 -42 -132 -24 -130 C -14 -152 26 -152 34 -128 C 56 -128 66 -102 56 -82"
    " C 62 -58 38 -44 22 -50 C 8 -40 -12 -40 -22 -50 C -44 -46 -62 -62 -58 -84"
)
CROWN_SHADE = path(
    "M 34 -128 C 56 -128 66 -102 56 -82 C 62 -58 38 -44 22 -50 C 8 -40 -12 -40 -22 -50"
    " C 20 -56 42 -84 34 -128"
)
BUSH = path(
    "M -34 4 C -40 -18 -20 -24 -14 -18 C -10 -36 14 -36 16 -18 C 28 -24 40 -12 34 4 C 16 12 -16 12 -34 4"
)
BIRD = path("M -20 -3 C -12 -12 2 -12 9 -4 L 18 -2 L 9 2 C 4 11 -8 11 -14 4 L -30 8")
BIRD_WING = path("M -14 -3 C -6 -6 2 -4 4 0 C 0 6 -10 6 -18 8 C -16 4 -16 0 -14 -3")

Piece = tuple[str, float, float, str]
"""A plant: kind, x, size and color."""


def _trunk(sheet: Sheet, top: float, width: float, color: str) -> None:
    half = width / 2.0
    sheet.fill(np.array([[-half * 0.7, top], [half * 0.7, top], [half, 6.0], [-half, 6.0]]), color, wrap="x")


def _fir(sheet: Sheet, color: str) -> None:
    _trunk(sheet, -30.0, 11.0, BARK)
    for lift, size in ((-22.0, 1.12), (-60.0, 0.9), (-96.0, 0.68), (-126.0, 0.48)):
        sheet.fill(TIER * size + [0.0, lift], color, wrap="x")
        sheet.fill(TIER_SHADE * size + [0.0, lift], _shade(color), wrap="x")


def _leafy(sheet: Sheet, color: str) -> None:
    sheet.fill(DROP, color, wrap="x")
    sheet.fill(DROP_SHADE, _shade(color), wrap="x")
    _trunk(sheet, -128.0, 7.0, BARK)
    for height, reach in ((-52.0, 26.0), (-76.0, 22.0), (-100.0, 14.0)):
        for side in (-1.0, 1.0):
            sheet.line(np.array([[0.0, height], [side * reach, height - reach * 0.9]]), 3.6, BARK, wrap="x")


def _oak(sheet: Sheet, color: str) -> None:
    _trunk(sheet, -70.0, 15.0, WOOD)
    for side in (-1.0, 1.0):
        sheet.line(np.array([[0.0, -44.0], [side * 20.0, -66.0]]), 5.0, WOOD, wrap="x")
    sheet.fill(CROWN, color, wrap="x")
    sheet.fill(CROWN_SHADE, _shade(color), wrap="x")
    for x, y in ((-34.0, -96.0), (-14.0, -116.0), (-10.0, -82.0), (10.0, -104.0), (-32.0, -72.0)):
        sheet.line(path("M -6 0 C -3 4 3 4 6 0") + [x, y], 2.6, _light(color), wrap="x")


def _birch(sheet: Sheet, color: str) -> None:
    _trunk(sheet, -120.0, 12.0, BIRCH)
    sheet.fill(ellipse(0.0, -112.0, 38.0, 56.0), color, wrap="x")
    sheet.fill(_half_moon(38.0, 56.0) + [0.0, -112.0], _shade(color), wrap="x")
    _trunk(sheet, -138.0, 8.0, BIRCH)
    _trunk(sheet, -60.0, 12.0, BIRCH)
    for height, reach in ((-78.0, 17.0), (-98.0, 15.0), (-116.0, 11.0)):
        for side in (-1.0, 1.0):
            sheet.line(np.array([[0.0, height], [side * reach, height - reach]]), 3.2, BIRCH, wrap="x")
    for height, side in ((-48.0, -1.0), (-34.0, 1.0), (-18.0, -1.0), (-6.0, 1.0)):
        sheet.line(np.array([[side * 5.0, height], [side * 0.5, height + 1.0]]), 2.8, INK, wrap="x")


def _bush(sheet: Sheet, color: str) -> None:
    sheet.fill(BUSH, color, wrap="x")
    for x, y in ((-16.0, -6.0), (2.0, -16.0), (18.0, -4.0), (0.0, 0.0)):
        sheet.fill(ellipse(x, y, 3.0), _light(color), wrap="x")


def _toadstool(sheet: Sheet, color: str) -> None:
    sheet.fill(path("M -4 -14 L 4 -14 C 4 -4 7 2 7 5 L -7 5 C -7 2 -4 -4 -4 -14"), CREAM, wrap="x")
    sheet.fill(path("M -17 -12 C -17 -32 17 -32 17 -12 C 8 -8 -8 -8 -17 -12"), color, wrap="x")
    for dot in ((-8.0, -16.0, 2.6), (1.0, -21.0, 3.0), (9.0, -15.5, 2.4)):
        sheet.fill(ellipse(*dot), CREAM, wrap="x")


def _bird(sheet: Sheet, color: str) -> None:
    sheet.fill(BIRD, color, wrap="x")
    sheet.fill(BIRD_WING, _shade(color), wrap="x")
    sheet.fill(ellipse(4.0, -4.0, 1.8), INK, wrap="x")


PLANTS = {"fir": _fir, "leafy": _leafy, "oak": _oak, "birch": _birch, "bush": _bush, "toadstool": _toadstool}

# By hill, from left to right; a plant stands on the line of its hill.
FOREST: tuple[tuple[Piece, ...], ...] = (
    (("fir", 70, 1.0, PINE), ("birch", 150, 0.95, MOSS), ("toadstool", 205, 0.8, RUST),
     ("oak", 285, 1.05, FERN), ("leafy", 402, 0.86, SPRUCE), ("fir", 476, 0.82, SPRUCE),
     ("bush", 528, 0.7, FERN), ("oak", 604, 0.8, OCHRE)),
    (("leafy", 36, 1.0, FERN), ("bush", 104, 0.8, MOSS), ("fir", 190, 1.08, SPRUCE),
     ("fir", 252, 0.7, PINE), ("birch", 338, 1.0, OCHRE), ("oak", 448, 0.95, SPRUCE),
     ("toadstool", 512, 0.9, RUST), ("fir", 566, 0.96, PINE)),
    (("oak", 96, 1.0, SPRUCE), ("toadstool", 22, 0.9, RUST), ("leafy", 196, 0.9, RUST),
     ("bush", 262, 0.8, FERN), ("fir", 338, 1.0, PINE), ("birch", 416, 0.9, FERN),
     ("leafy", 522, 1.02, PINE), ("fir", 600, 0.74, FERN)),
)  # fmt: skip
BIRDS = ((530.0, 84.0, 0.9, False, ROSE), (104.0, 284.0, 0.9, True, ROSE), (268.0, 512.0, 0.9, True, ROSE))


def _mixed(color: str, other: int, share: float) -> str:
    channels = (int(color[i : i + 2], 16) for i in (1, 3, 5))
    return "#" + "".join(f"{round(c + (other - c) * share):02x}" for c in channels)


def _shade(color: str) -> str:
    return _mixed(color, 0, 0.13)


def _light(color: str) -> str:
    return _mixed(color, 255, 0.34)


def _half_moon(rx: float, ry: float) -> Outline:
    """The right side of an ellipse, hollow on its left."""
    angle = np.linspace(-np.pi / 2.0, np.pi / 2.0, 48)
    outer = np.stack([rx * np.cos(angle), ry * np.sin(angle)], axis=1)
    inner = np.stack([0.45 * rx * np.cos(angle), ry * np.sin(angle)], axis=1)
    return np.concatenate([outer, inner[::-1]])


def _height(hill: int, x: NDArray[np.float64] | float) -> NDArray[np.float64] | float:
    """The y of a hill's line: a wave that fits the width."""
    turn = 2.0 * np.pi / WIDTH
    wave = 9.0 * np.sin(turn * x + 2.1 * hill) + 4.0 * np.sin(2.0 * turn * x + 1.3 * hill)
    return 188.0 + hill * HEIGHT / 3.0 + wave


def _hill(sheet: Sheet, hill: int, lift: float) -> None:
    x = np.linspace(0.0, WIDTH, 161)
    line = np.stack([x, np.asarray(_height(hill, x))], axis=1)
    ground = np.concatenate([line, [[WIDTH, HEIGHT * 3.0], [0.0, HEIGHT * 3.0]]])
    sheet.place(0.0, lift).fill(ground, HILLS[hill], wrap="")
    for kind, at, size, color in FOREST[hill]:
        flip = int(at) % 4 == 2
        sheet.place(at, float(_height(hill, at)) + lift, size, flip=flip)
        PLANTS[kind](sheet, color)


def draw() -> NDArray[np.uint8]:
    """640 x 640 texels; hills are drawn from the farthest (top) to the nearest, once more above and below."""
    sheet = Sheet(WIDTH, HEIGHT, HILLS[-1])
    for lift in (-float(HEIGHT), 0.0, float(HEIGHT)):
        for hill in range(len(HILLS)):
            _hill(sheet, hill, lift)
    for x, y, size, flip, color in BIRDS:
        _bird(sheet.place(x, y, size, flip=flip), color)
    return sheet.picture()
