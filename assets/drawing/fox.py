"""The fox wallpaper: foxes that sit and foxes that sleep, among leaves, toadstools and berries."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drawing.sheet import Sheet, ellipse, mirrored, path

PAPER, ORANGE, RUST, CHESTNUT, CREAM, DARK = "#c8e2e2", "#e67c33", "#cf6124", "#b04c1c", "#fff6e6", "#4a2b22"
TEAL, SAGE, RED, BLUSH = "#3f7f78", "#8db59a", "#c8443c", "#f0a070"

EAR = path("M -50 2 C -56 -24 -54 -50 -48 -66 C -30 -56 -16 -46 -8 -34")
EAR_INSIDE = path("M -44 -16 C -47 -32 -46 -44 -43 -52 C -33 -46 -26 -40 -21 -33")
FACE = path("M 0 48 C -16 46 -30 34 -62 12 C -56 -18 -36 -40 0 -40 C 36 -40 56 -18 62 12 C 30 34 16 46 0 48")
CHEEK = path("M 0 48 C -16 46 -30 34 -62 12 C -44 -2 -18 -4 -10 14 C -7 24 -5 32 0 36")
SMILE = path("M -8 4 C -4 9 4 9 8 4")

BODY = path("M 0 20 C -34 30 -52 84 -46 132 C -46 146 46 146 46 132 C 52 84 34 30 0 20")
CHEST = path(
    "M 0 36 C -24 40 -32 62 -26 76 L -16 72 L -12 88 L 0 80 L 12 88 L 16 72 L 26 76 C 32 62 24 40 0 36"
)
LEG = path("M -4 92 C -6 110 -6 130 -4 140 C -12 146 -30 146 -30 138 C -28 122 -26 108 -24 94")
SOCK = path("M -5 116 C -6 126 -6 134 -4 140 C -12 146 -30 146 -30 138 C -29 130 -28 122 -27 116")
TAIL = path(
    "M 30 138 C 84 150 128 122 124 74 C 122 44 104 24 84 16 C 92 44 84 66 66 80 C 50 92 38 104 36 122"
)
TAIL_TIP = path("M 124 74 C 122 44 104 24 84 16 C 88 30 88 42 85 52 L 96 50 L 100 62 L 110 60 L 113 74")

CURLED = path(
    "M -96 20 C -100 -40 -40 -66 10 -64 C 66 -62 98 -24 94 14 C 90 50 40 62 0 60 C -50 60 -92 50 -96 20"
)
BACK = path("M 10 -64 C 66 -62 98 -24 94 14 C 92 34 76 46 56 53 C 72 20 60 -34 10 -64")
WRAP = path("M 88 -6 C 108 40 60 76 0 74 C -36 72 -64 60 -74 44 C -50 46 -24 44 -4 36 C 20 26 36 24 48 6")
WRAP_TIP = path("M -14 73 C -42 70 -64 60 -74 44 C -58 46 -44 45 -32 43 L -30 54 L -20 52 L -20 64")

SPRIGS = (
    (300.0, 78.0, 14.0, TEAL), (22.0, 210.0, -12.0, SAGE), (310.0, 398.0, -14.0, TEAL),
    (606.0, 524.0, 12.0, SAGE), (318.0, 250.0, 24.0, SAGE), (306.0, 570.0, -24.0, SAGE),
    (598.0, 60.0, -22.0, TEAL), (24.0, 372.0, 22.0, TEAL),
)  # fmt: skip

LEAF = path("M 0 0 C -13 -12 -13 -30 0 -46 C 13 -30 13 -12 0 0")
CAP = path("M -30 0 C -30 -32 30 -32 30 0 C 16 8 -16 8 -30 0")
STALK = path("M -9 2 C -8 16 -12 26 -13 34 C -6 39 6 39 13 34 C 12 26 8 16 9 2")


def _head(sheet: Sheet, asleep: bool) -> None:
    for side in (EAR, mirrored(EAR)):
        sheet.fill(side, ORANGE)
    for side in (EAR_INSIDE, mirrored(EAR_INSIDE)):
        sheet.fill(side, DARK)
    sheet.fill(FACE, ORANGE)
    for side in (CHEEK, mirrored(CHEEK)):
        sheet.fill(side, CREAM)
    for x in (-25.0, 25.0):
        if asleep:
            sheet.line(SMILE + [x, 0.0], 3.6, DARK)
        else:
            sheet.fill(ellipse(x * 0.92, 3.0, 5.6, 6.6), DARK)
            sheet.fill(ellipse(x * 0.92 + 1.8, 0.6, 1.9), CREAM)
        sheet.fill(ellipse(x * 1.35, 16.0, 6.0, 3.8), BLUSH)
    sheet.fill(ellipse(0.0, 42.0, 8.0, 6.4), DARK)
    sheet.fill(ellipse(-2.4, 39.8, 2.2, 1.5), CREAM)


def _sitting(sheet: Sheet, x: float, y: float, flip: bool) -> None:
    sheet.place(x, y, 0.92, 0.0, flip)
    sheet.fill(TAIL, RUST)
    sheet.fill(TAIL_TIP, CREAM)
    sheet.fill(BODY, ORANGE)
    sheet.fill(CHEST, CREAM)
    for leg, sock in ((LEG, SOCK), (mirrored(LEG), mirrored(SOCK))):
        sheet.fill(leg, RUST)
        sheet.fill(sock, DARK)
    _head(sheet, asleep=False)


def _sleeping(sheet: Sheet, x: float, y: float, flip: bool) -> None:
    sheet.place(x, y, 0.98, 0.0, flip)
    sheet.fill(CURLED, RUST)
    sheet.fill(BACK, CHESTNUT)
    sheet.place(x + (36 if flip else -36), y - 2, 0.8, 14.0 if flip else -14.0, flip)
    _head(sheet, asleep=True)
    sheet.place(x, y, 0.98, 0.0, flip)
    sheet.fill(WRAP, CHESTNUT)
    sheet.fill(WRAP_TIP, CREAM)


def _sprig(sheet: Sheet, x: float, y: float, turn: float, color: str) -> None:
    sheet.place(x, y, 0.78, turn)
    sheet.line(path("M 0 52 C 4 20 -4 -10 0 -34"), 4.0, color)
    sheet.fill(LEAF + [0.0, -26.0], color)
    for height, lean in ((8.0, 62.0), (34.0, 70.0)):
        for side in (-1.0, 1.0):
            angle = np.radians(turn + side * lean)
            up = np.radians(turn)
            foot = np.array([x, y]) + 0.78 * height * np.array([-np.sin(up), np.cos(up)])
            sheet.place(foot[0], foot[1], 0.66, float(np.degrees(angle)))
            sheet.fill(LEAF, color)


def _toadstool(sheet: Sheet, x: float, y: float, size: float) -> None:
    sheet.place(x, y, size)
    sheet.fill(STALK, CREAM)
    sheet.fill(CAP, RED)
    for dot in ((-15.0, -8.0, 4.6), (1.0, -15.0, 5.2), (15.0, -6.0, 4.0), (-2.0, -2.0, 2.8)):
        sheet.fill(ellipse(*dot), CREAM)


def _berries(sheet: Sheet, x: float, y: float) -> None:
    sheet.place(x, y)
    for dx, dy, radius in ((0.0, 0.0, 6.5), (15.0, 7.0, 5.0), (3.0, 16.0, 4.2)):
        sheet.fill(ellipse(dx, dy, radius), RED)
        sheet.fill(ellipse(dx - radius * 0.3, dy - radius * 0.35, radius * 0.28), CREAM)


def draw() -> NDArray[np.uint8]:
    """640 x 640 texels, two foxes of either kind."""
    sheet = Sheet(640, 640, PAPER)
    _sitting(sheet, 140.0, 106.0, flip=False)
    _sitting(sheet, 468.0, 426.0, flip=True)
    _sleeping(sheet, 466.0, 160.0, flip=False)
    _sleeping(sheet, 146.0, 480.0, flip=True)
    for x, y, turn, color in SPRIGS:
        _sprig(sheet, x, y, turn, color)
    for x, y, size in ((384.0, 56.0, 0.9), (226.0, 374.0, 0.9), (176.0, 290.0, 0.62), (432.0, 610.0, 0.62)):
        _toadstool(sheet, x, y, size)
    for x, y in ((36.0, 70.0), (400.0, 272.0), (386.0, 384.0), (62.0, 592.0), (106.0, 366.0), (502.0, 46.0)):
        _berries(sheet, x, y)
    return sheet.picture()
