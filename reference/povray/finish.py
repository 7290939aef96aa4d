"""The model's formula in POV-Ray's terms, for one color or for a picture (document, sections 2 and 3).

POV-Ray multiplies ambient and diffuse light by the share 1 - filter of the pigment; they are divided by it
here. Highlights and mirror images take the color of the surface only by `metallic` or by a color of their
own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reference.povray.text import number, vector
from tracer.material import Material


@dataclass(frozen=True)
class Finish:
    """The looks of a material under the scene's `ambient` share a."""

    material: Material
    ambient: float

    def solid(self, color: np.ndarray) -> str:
        """Pigment and finish of one color (3,)."""
        through = self._direct * self.material.refraction
        pigment = f"pigment {{ rgb {vector(color)}{f' filter {number(through)}' if through else ''} }}"
        mirror = f"reflection {{ rgb {vector(self._direct * self.material.reflection * color)} }}"
        return f"{pigment} {self._finish(mirror)}"

    def picture(self, image_map: str) -> str:
        """Pigment and finish of a picture."""
        through = self._direct * self.material.refraction
        pigment = f"pigment {{ image_map {{ {image_map}{f' filter all {number(through)}' if through else ''}"
        mirror = f"reflection {{ rgb {number(self._direct * self.material.reflection)} metallic }}"
        return f"{pigment} }} }} {self._finish(mirror)}"

    @property
    def _direct(self) -> float:
        return 1 - self.ambient

    def _finish(self, mirror: str) -> str:
        material = self.material
        kept = 1 - self._direct * material.refraction
        own = self._direct * material.absorption
        words = [
            f"ambient {number(self.ambient / kept if kept > 0 else 0)}",
            f"diffuse {number(own * material.diffuse / kept if kept > 0 else 0)}",
        ]
        if own * material.specular > 0:
            words += [f"phong {number(own * material.specular)} phong_size {number(material.shininess)}"]
            words += ["metallic"]
        if material.reflection > 0:
            words += [mirror]
        return f"finish {{ {' '.join(words)} }}"
