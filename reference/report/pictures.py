"""Both pictures of a scene and their signed difference, as WebP inside the page."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from math import floor, log10

import cv2
import numpy as np

from reference.comparison.records import Panels
from reference.report.numbers import number

Array = np.ndarray

LOSSLESS = 101  # what OpenCV takes for it
MORE, LESS = (0xE0, 0x69, 0x14), (0x1F, 0x86, 0xD8)
"""Red, green, blue where ours is larger, and where Mitsuba's is; nothing is drawn where they agree. Both
stand out on light and on dark paper."""
ONE_SIDED = (0x80, 0x80, 0x80, 0xFF)
STEPS = 15
"""Shades a sign: more would be noise to the eye, and to the codec."""
THUMBNAIL = 96  # pixels across
EXACT = 1e-9  # by so much, in relation, a decimal end of a bar may be off
RINGS = 300
"""Rings on a picture, at most."""


@dataclass(frozen=True)
class Trio:
    """Data URIs of the three pictures and what is said of them. `range` is the symmetric range of the bar,
    in words (empty: no pixel differs); `beyond` counts the pixels outside it; `rings`: centers of circles
    with that `radius` [pixels]."""

    kind: str
    ours: str
    mitsuba: str
    difference: str
    width: int
    height: int
    range: str
    unit: str
    largest: str
    beyond: int
    differing: int
    one_sided: int
    radius: float
    rings: list[tuple[float, float]]
    near: str = ""
    far: str = ""


def trio_of(panels: Panels) -> Trio:
    """The pictures of an outcome, pixel by pixel as they were compared."""
    ours, mitsuba = (np.asarray(side, np.float64) for side in (panels.ours, panels.mitsuba))
    differs = np.asarray(panels.differs, bool)
    difference = ours - mitsuba
    near = far = ""
    one_sided = np.zeros(differs.shape, bool)
    if panels.kind == "color":
        largest = np.abs(difference).argmax(axis=-1)[..., None]
        difference = np.take_along_axis(difference, largest, axis=-1)[..., 0]
        pictures = [_color(side) for side in (ours, mitsuba)]
    else:
        one_sided = (ours < 0) != (mitsuba < 0)
        difference = np.where(one_sided, 0, difference)
        pictures, (near, far) = _depths(ours, mitsuba)
    limit = _limit(difference, differs | one_sided)
    rows, columns = np.nonzero(differs)
    return Trio(
        kind=panels.kind,
        ours=_uri(pictures[0]),
        mitsuba=_uri(pictures[1]),
        difference=_uri(_signed(difference, limit, one_sided)),
        width=differs.shape[1],
        height=differs.shape[0],
        range=number(limit) if limit else "",
        unit=_unit(panels.kind, ours, limit),
        largest=number(float(np.abs(difference).max(initial=0))),
        beyond=int((np.abs(difference) > limit * (1 + EXACT)).sum()),
        differing=int(differs.sum()),
        one_sided=int(one_sided.sum()),
        radius=max(1.4, differs.shape[1] / 50),
        rings=[(float(x) + 0.5, float(y) + 0.5) for x, y in zip(columns, rows, strict=True)][:RINGS],
        near=near,
        far=far,
    )


def thumbnail(panels: Panels) -> str:
    """Our picture, small, as a data URI; codec losses are of no account here."""
    picture = _color(np.asarray(panels.ours, np.float64))
    height, width = picture.shape[:2]
    size = (THUMBNAIL, max(1, round(height * THUMBNAIL / width)))
    return _uri(np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA)), 70)


def bar() -> str:
    """The color bar of a difference as stops of a CSS gradient, see-through in the middle."""
    less, more = (" ".join(map(str, color)) for color in (LESS, MORE))
    return f"rgb({less}) 0%, rgb({less} / 0) 50%, rgb({more} / 0) 50%, rgb({more}) 100%"


def viridis_bar(count: int = 9) -> str:
    """The color bar of a depth buffer from near to far."""
    (row,) = _viridis(np.linspace(1, 0, count)[None])
    return ", ".join(f"rgb({r} {g} {b})" for b, g, r, _ in row.tolist())


def _color(picture: Array) -> Array:
    """Display values as a screen shows them, blue first."""
    shown = np.clip(np.nan_to_num(picture), 0, 1)
    return np.floor(255 * shown + 0.5).astype(np.uint8)[..., ::-1]


def _depths(ours: Array, mitsuba: Array) -> tuple[list[Array], tuple[str, str]]:
    """Near is bright, on the same logarithmic scale on both sides; what hits nothing is see-through."""
    hit = np.concatenate([side[side > 0] for side in (ours, mitsuba)])
    if not hit.size:
        blank = np.zeros((*ours.shape, 4), np.uint8)
        return [blank, blank], ("", "")
    near, far = float(hit.min()), float(hit.max())
    span = np.log(far / near) or 1.0
    pictures = []
    for side in (ours, mitsuba):
        picture = _viridis(1 - np.log(np.maximum(side, near) / near) / span)
        picture[side < 0] = 0
        pictures.append(picture)
    return pictures, (number(near), number(far))


def _viridis(brightness: Array) -> Array:
    levels = np.floor(255 * np.clip(brightness, 0, 1) + 0.5).astype(np.uint8)
    colors = np.asarray(cv2.applyColorMap(levels, cv2.COLORMAP_VIRIDIS), np.uint8)
    return np.concatenate([colors, np.full((*colors.shape[:2], 1), 255, np.uint8)], axis=-1)


def _limit(difference: Array, apart: Array) -> float:
    """The end of the bar, 1, 2 or 5: beyond it are one in a hundred of the differences of pixels that are not
    counted as different. With the very largest as the end all the rest would have one shade."""
    rest = np.abs(difference[~apart & (difference != 0)])
    largest = float(np.quantile(rest, 0.99)) if rest.size else float(np.abs(difference).max(initial=0))
    if not largest:
        return 0.0
    power = 10.0 ** floor(log10(largest))
    return next(
        float(f"{step * power:.1g}") for step in (1, 2, 5, 10) if step * power * (1 + EXACT) >= largest
    )


def _signed(difference: Array, limit: float, one_sided: Array) -> Array:
    """Blue, green, red and opacity of signed differences (h, w)."""
    share = np.clip(difference / limit, -1, 1) if limit else np.zeros_like(difference)
    opacity = np.ceil(np.abs(share) * STEPS) / STEPS
    colors = np.where((share > 0)[..., None], MORE[::-1], LESS[::-1])
    picture = np.concatenate([colors, np.floor(255 * opacity + 0.5)[..., None]], axis=-1)
    picture[opacity == 0] = 0
    picture[one_sided] = ONE_SIDED
    return picture.astype(np.uint8)


def _unit(kind: str, ours: Array, limit: float) -> str:
    """The unit of the bar; lengths of a scene also as steps of the largest depth's last bit."""
    if kind == "color":
        return "display value"
    step = float(np.spacing(np.float32(max(ours.max(initial=0), 0))))
    return f"lengths of the scene = {number(limit / step)} ulp of its largest depth" if limit else ""


def _uri(picture: Array, quality: int = LOSSLESS) -> str:
    data = cv2.imencode(".webp", picture, [cv2.IMWRITE_WEBP_QUALITY, quality])[1].tobytes()
    return "data:image/webp;base64," + base64.b64encode(data).decode("ascii")
