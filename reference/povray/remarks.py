"""What of a scene has no counterpart in POV-Ray, in sentences for the exported file and for the user."""

from __future__ import annotations

from collections.abc import Sequence

from reference.povray.textures import MOST_STRIPES, is_flat, truncates
from reference.povray.view import PARTLY
from tracer.device_meshes import inherited, source_of
from tracer.lights import AreaLight
from tracer.scene import Scene
from tracer.shapes import Mesh
from tracer.textures import PictureTexture, Stripes

MOST_LEVELS = 256
"""POV-Ray's largest `max_trace_level`."""


def remarks_of(scene: Scene, places: Sequence[int]) -> list[str]:
    """Sentences that apply to this scene; `places` of its shapes before the canvas, see `view`."""
    remarks = _of_view(scene, places) + _of_materials(scene) + _of_textures(scene) + _of_options(scene)
    return [sentence for applies, sentence in remarks if applies]


def _of_view(scene: Scene, places: Sequence[int]) -> list[tuple[bool, str]]:
    partly = [f"`{scene.shapes[n].name or n}`" for n, place in enumerate(places) if place == PARTLY]
    names = ", ".join(partly[:5]) + (f" and {len(partly) - 5} more" if len(partly) > 5 else "")
    return [(bool(partly), f"What of {names} lies between the eye and the canvas is seen, too.")]


def _of_materials(scene: Scene) -> list[tuple[bool, str]]:
    materials = list(scene.materials.values())
    traced = any(m.reflection > 0 or m.refraction > 0 for m in materials)
    bends = any(m.refraction > 0 and m.ior != 1 for m in materials)
    return [
        (any(m.specular > 0 for m in materials), "Highlights turn white where light grazes the surface."),
        (traced, "The cut-off counts the colors on the way and the share 1 - ambient, too."),
        (bends, "Total reflection mirrors all of the light, whatever the share that is refracted."),
        (scene.max_depth >= MOST_LEVELS, f"Paths end after {MOST_LEVELS - 1} bounces."),
    ]


def _of_textures(scene: Scene) -> list[tuple[bool, str]]:
    textures = list(scene.textures.values())
    flat = any(isinstance(t, PictureTexture) and is_flat(t) for t in textures)
    many = any(isinstance(t, Stripes) and len(t.colors) > MOST_STRIPES for t in textures)
    wide = any(isinstance(t, PictureTexture) and truncates(t, scene.literal) for t in textures)
    return [
        (wide, "The texels next to 0 are as wide as all others, and pictures are not mirrored there."),
        (flat or many, "Some textures are replaced by their mean color."),
        (_has_shining_picture(scene), "A picture on a mirror or on glass colors what is seen there roughly."),
    ]


def _of_options(scene: Scene) -> list[tuple[bool, str]]:
    focus = scene.camera.depth_of_field
    seen = any(scene.background) and not scene.secondary_background
    smooth = any(
        inherited(scene, shape, "smooth")
        for shape in scene.shapes
        if isinstance(source_of(scene, shape), Mesh)
    )
    jitters = any(isinstance(light, AreaLight) and light.jitter for light in scene.lights)
    return [
        (smooth, "A smooth normal that faces away from the ray is turned around."),
        (jitters, "The samples of area lights stand still, without jitter."),
        (scene.diffuse_term == "reflection", "The diffuse term is Lambert's."),
        (seen, "Mirrors and glass show the background."),
        (focus is not None and focus.focus > 0, "Depth of field, a filter over the picture, is left out."),
    ]


def _has_shining_picture(scene: Scene) -> bool:
    for shape in scene.shapes:
        texture, material = (inherited(scene, shape, key) for key in ("texture", "material"))
        if texture is None or material is None or not isinstance(scene.textures[texture], PictureTexture):
            continue
        if scene.materials[material].reflection > 0 or scene.materials[material].refraction > 0:
            return True
    return False
