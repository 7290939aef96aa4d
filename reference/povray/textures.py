"""The textures in POV-Ray's terms: one function a kind, each a whole `texture`.

A pattern is looked up in the scene's own coordinates: the mirrored z is in the texture's transformation.
Cells begin a little earlier, so that a surface on the border of two cells gets one color all over, as in the
model (document, section 6).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from reference.povray.finish import Finish
from reference.povray.text import Space
from tracer.records import Color
from tracer.textures import CellTexture, Checker, PictureTexture, Solid, Stripes

SHIFT = 1e-5
"""Cells begin so much earlier, in cells."""

MOST_STRIPES = 128
"""POV-Ray's maps have 256 entries, two a stripe."""


@dataclass(frozen=True)
class Ground:
    """What an adapter may ask: the `finish`, POV-Ray's `space` and the scene's `extent`, `back` (4, 4) from
    the world to the texture's argument, `decode`: colors as they are shaded, `copy`: the name of a picture's
    copy beside the file with its pixels, `literal`: the scene's default of cell rule and `flip_v`."""

    finish: Finish
    space: Space
    extent: float
    back: np.ndarray
    decode: Callable[[np.ndarray], np.ndarray]
    copy: Callable[[str], tuple[str, np.ndarray]]
    literal: bool


def solid(texture: Solid, on: Ground) -> str:
    """One color all over."""
    return f"texture {{ {on.finish.solid(on.decode(np.array(texture.color)))} }}"


def checker(texture: Checker, on: Ground) -> str:
    """The cubes of POV-Ray's own pattern."""
    scale = np.diag([1 / texture.interval] * 3 + [1.0])
    if truncates(texture, on.literal):
        cells = "+".join(f"floor(abs({axis})+{SHIFT})" for axis in "xyz")
        return _steps(texture.colors, f"function {{ mod({cells}, 2)/2 + 0.25 }}", scale[:3], on)
    scale[:3, 3] = SHIFT
    parts = " ".join(solid(Solid(color=color), on) for color in texture.colors)
    return f"texture {{ checker {parts} {on.space.pattern((scale @ on.back)[:3])} }}"


def stripes(texture: Stripes, on: Ground) -> str:
    """A gradient with steps, begun so far away that it is positive all over the scene; the mean color where
    there are too many."""
    count = len(texture.colors)
    if count > MOST_STRIPES:
        mean = on.decode(np.array(texture.colors)).mean(axis=0)
        return f"texture {{ {on.finish.solid(mean)} }}"
    rate = 1 / (count * texture.interval)
    row = np.array([[rate, rate, rate, 0.0]])
    if truncates(texture, on.literal):
        cells = f"mod(floor({count}*abs(x)+{SHIFT}), {count})"
        return _steps(texture.colors, f"function {{ ({cells} + 0.5)/{count} }}", _whole(row)[:3], on)
    row[0, 3] = np.ceil(4 * on.extent * rate) + 1 + SHIFT / count
    return _steps(texture.colors, "gradient x", _whole(row)[:3], on)


def picture(texture: PictureTexture, on: Ground) -> str:
    """The picture laid across x and y of its pattern, again and again; its mean color where the matrix maps
    space to a line."""
    name, texels = on.copy(texture.file)
    height, width = texels.shape[:2]
    rows = texture.texel_matrix() / [[width], [height]]  # type: ignore[attr-defined]
    if is_flat(texture):
        color = on.decode(texels.reshape(-1, 3)).mean(axis=0)
        return f"texture {{ {on.finish.solid(color)} }}"
    if texture.filter == "nearest":
        rows[:, 3] += np.array([SHIFT / width, SHIFT / height])
    if on.literal if texture.flip_v is None else texture.flip_v:
        rows[1] *= -1
    smooth = " interpolate 2" if texture.filter == "bilinear" else ""
    look = on.finish.picture(f'png "{name}" gamma srgb{smooth}')
    return f"texture {{ {look} {on.space.pattern((_whole(rows) @ on.back)[:3])} }}"


def truncates(texture: CellTexture, literal: bool) -> bool:
    """Whether cell numbers are cut off towards zero and counted by absolute value."""
    return texture.index == "truncate" or (texture.index is None and literal)


def is_flat(texture: PictureTexture) -> bool:
    """Whether all points of a plane in space have one texel: no transformation of POV-Ray's does that."""
    linear = texture.texel_matrix()[:, :3]  # type: ignore[attr-defined]
    sizes = np.linalg.svd(linear, compute_uv=False)
    return bool(sizes[1] <= 1e-12 * sizes[0])


def _steps(colors: Sequence[Color], pattern: str, to_pattern: np.ndarray, on: Ground) -> str:
    """Equal steps of colors over the range 0 to 1 of a pattern."""
    steps = []
    for number, color in enumerate(colors):
        part = on.finish.solid(on.decode(np.array(color)))
        steps += [f"[{end}/{len(colors)} {part}]" for end in (number, number + 1)]
    where = on.space.pattern((np.vstack([to_pattern, [0, 0, 0, 1]]) @ on.back)[:3])
    return f"texture {{ {pattern} texture_map {{ {' '.join(steps)} }} {where} }}"


def _whole(rows: np.ndarray) -> np.ndarray:
    """(4, 4): an invertible map that begins with the rows (1 or 2, 4) given."""
    linear = rows[:, :3]
    rest = np.linalg.svd(linear)[2][len(linear) :] * np.linalg.norm(linear, axis=1).max()
    whole = np.eye(4)
    whole[: len(rows)] = rows
    whole[len(rows) : 3, :3] = rest
    return whole
