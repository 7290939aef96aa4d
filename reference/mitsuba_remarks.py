"""What of a scene has no counterpart in Mitsuba, in sentences for the exported file and for the user."""

from __future__ import annotations

from collections.abc import Sequence

from reference.mitsuba_looks import Look
from tracer.lights import PointLight
from tracer.material import Material
from tracer.scene import Scene
from tracer.textures import CellTexture, TextureRecord


def remarks_of(scene: Scene, looks: Sequence[Look]) -> list[str]:
    """Sentences that apply to this scene; geometry, camera and depth are the same in both."""
    return [sentence for applies, sentence in _remarks(scene, looks) if applies]


def _remarks(scene: Scene, looks: Sequence[Look]) -> list[tuple[bool, str]]:
    materials: list[Material] = list(scene.materials.values())
    focus = scene.camera.depth_of_field
    return [
        (True, "Light bounces on from diffuse surfaces, which the model replaces by its ambient share."),
        (
            bool(scene.lights),
            "Light falls off with distance; it is as strong as half of the pixels need it to be.",
        ),
        (
            any(not isinstance(light, PointLight) for light in scene.lights),
            "An area light is the set of its samples, one point emitter each, without jitter.",
        ),
        (any(look.is_mean for look in looks), "Some textures are replaced by their mean color."),
        (
            any(_truncates(scene, texture) for texture in scene.textures.values()),
            "The cells next to 0 are as wide as all others.",
        ),
        (any(m.diffuse > 1 for m in materials), "Factors `diffuse` above 1 count as 1."),
        (any(m.specular > 0 for m in materials), "Phong's highlights are left out."),
        (
            any(m.refraction > 0 for m in materials),
            "Glass divides light by Fresnel's formulas, not by constant shares; it throws caustics.",
        ),
        (any(m.reflection > 0 for m in materials), "There is no cut-off; paths end after 24 bounces."),
        (focus is not None and focus.focus > 0, "Depth of field, a filter over the picture, is left out."),
        (any(scene.background), "The background is black."),
    ]


def _truncates(scene: Scene, texture: TextureRecord) -> bool:
    """Whether cell numbers are cut off towards zero, so that the cells around 0 are wider."""
    if not isinstance(texture, CellTexture):
        return False
    return texture.index == "truncate" or (texture.index is None and scene.literal)
