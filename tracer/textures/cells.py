"""From a coordinate to the number of a cell (document, section 6).

F(q) = floor(q + eps): the small value puts a surface that lies exactly on a border into one cell all over. It
must outweigh the rounding of the point, so it grows with the point's largest coordinate in single precision.
It outweighs also that coordinates are multiplied by 1/interval in place of a division.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from tracer.backends import Backend
from tracer.ray import select_max


@dataclass
class CellRule:
    """How coordinates become cells: `truncate` (a mask) asks for the document's own rule, rounding towards
    zero."""

    backend: Backend
    truncate: Any

    def cell(self, q: Any, largest: Any) -> Any:
        """F(q), a whole number as a float; `largest`: the point's largest |coordinate| in cells."""
        one = self.backend.Float(1)
        if self.backend.precision == "single":
            shift = 1e-5 * select_max(largest, one)
        else:
            shift = 1e-6 * select_max(dr.abs(q), one)
        if self.truncate is False:
            return dr.floor(q + shift)
        toward_zero = dr.mulsign(dr.floor(dr.abs(q) + shift), q)
        return dr.select(self.truncate, toward_zero, dr.floor(q + shift))

    def magnitude(self, cell: Any) -> Any:
        """|cell| where the document's rule holds (it counts cells by absolute value), else the cell
        itself."""
        return cell if self.truncate is False else dr.select(self.truncate, dr.abs(cell), cell)


def modulo(a: Any, n: Any) -> Any:
    """a mod n in 0 .. n-1 for whole numbers in floats: exact below 2^24 (2^53), never out of range beyond."""
    rest = a - n * dr.floor(a * dr.rcp(n))
    rest = dr.select(rest < 0, rest + n, rest)
    return dr.select((rest >= 0) & (rest < n), rest, 0)
